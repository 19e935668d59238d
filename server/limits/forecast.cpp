#include "server/limits/forecast.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <string>

namespace clearance {
namespace {

/// How much of a figure the newest query makes.
constexpr double kNewest = 0.25;
/// What a query that was given up is taken to have needed, in terms of what it had: at the least as much, and so few
/// are tried in vain.
constexpr double kGivenUp = 2;
/// The most that one query raises a figure by: one that the system kept from its CPU for long tells nothing of the
/// others.
constexpr double kMostRise = 2;
/// What a refusal leaves of a figure.
constexpr double kAfterRefusal = 0.95;

std::string ms(std::chrono::nanoseconds time) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g ms", 1e-6 * static_cast<double>(time.count()));
  return text;
}

RejectedRequest late(std::chrono::nanoseconds deadline, const std::string& why) {
  return {wire::ErrorCode::kDeadline, "no answer within the " + ms(deadline) + " of its deadline_ns: " + why};
}

}  // namespace

Forecast::Work Forecast::work_of(const QueryOptions& query, const QueryCost& extent) {
  const auto reduce = static_cast<std::uint32_t>(query.reduce);
  const auto kind = query.fields & kFieldFreeScale ? 45u
                    : query.max_steps > 0          ? 40 + reduce
                                                   : reduce * 8 + (query.signed_distance ? 4u : 0u) +
                                                (query.precision == Precision::kF32 ? 2u : 0u) +
                                                (std::isfinite(query.max_distance) ? 1u : 0u);
  const auto of_model = query.model == Model::kPieces ? kKinds / 2 : 0u;
  return {of_model + kind, std::max<std::uint64_t>(extent.piece_pairs, 1)};
}

/// Queries of four times as many pairs are another kind: those of few pay for their beginning above all.
std::uint32_t Forecast::index(const Work& work) {
  const auto size = static_cast<std::uint32_t>(std::bit_width(work.piece_pairs)) / 2;
  return std::min(work.kind, kKinds - 1) * kSizes + std::min(size, kSizes - 1);
}

void Forecast::note(const Work& work, std::chrono::nanoseconds took, bool is_whole) {
  double& figure = ns_per_piece_pair_[index(work)];
  double seen = static_cast<double>(took.count()) / static_cast<double>(work.piece_pairs);
  if (!is_whole) seen *= kGivenUp;
  if (figure > 0) seen = std::min(seen, kMostRise * figure);
  if (!is_whole)
    figure = std::max(figure, seen);
  else
    figure = figure > 0 ? figure + kNewest * (seen - figure) : seen;
}

std::optional<std::chrono::nanoseconds> Forecast::of(const Work& work) const {
  const double figure = ns_per_piece_pair_[index(work)];
  if (figure <= 0) return std::nullopt;
  const double ns = std::min(figure * static_cast<double>(work.piece_pairs), 9e18);
  return std::chrono::nanoseconds(static_cast<std::int64_t>(ns));
}

void Forecast::check(const Work& work, std::chrono::nanoseconds left, std::chrono::nanoseconds deadline) {
  const auto takes = of(work);
  if (!takes || *takes <= left) return;
  ns_per_piece_pair_[index(work)] *= kAfterRefusal;
  throw late(deadline, "it would take about " + ms(*takes) + ", by what like queries took");
}

RejectedRequest deadline_passed(std::chrono::nanoseconds deadline, std::chrono::nanoseconds worked) {
  if (worked.count() == 0) return late(deadline, "it was waiting, or its pairs were still being listed");
  return late(deadline, "it was given up after " + ms(worked) + " of work");
}

}  // namespace clearance
