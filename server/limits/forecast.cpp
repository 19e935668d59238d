#include "server/limits/forecast.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <string>

namespace clearance {
namespace {

/// Weight of the newest query.
constexpr double kNewest = 0.25;
/// Factor on the time of a query that was given up, which needs at least that time. A high factor avoids futile
/// attempts.
constexpr double kGivenUp = 2;
/// Largest factor by which one query raises an estimate, since a query that the system suspended for long is no measure
/// for others.
constexpr double kMostRise = 2;
/// Factor on an estimate after a rejection.
constexpr double kAfterRejection = 0.95;

std::string ms(std::chrono::nanoseconds time) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g ms", 1e-6 * static_cast<double>(time.count()));
  return text;
}

RejectedRequest late(std::chrono::nanoseconds deadline, const std::string& why) {
  return {wire::ErrorCode::kDeadline, "no answer within the " + ms(deadline) + " of its deadline_ns: " + why};
}

}  // namespace

Forecast::Work Forecast::work_of(const QueryOptions& query, const QueryCost& cost) {
  const auto reduce = static_cast<std::uint32_t>(query.reduce);
  const auto kind = query.fields & kFieldFreeScale ? 45u
                    : query.max_evaluations > 0    ? 40 + reduce
                                                   : reduce * 8 + (query.signed_distance ? 4u : 0u) +
                                                      (query.precision == Precision::kF32 ? 2u : 0u) +
                                                      (std::isfinite(query.max_distance) ? 1u : 0u);
  return {kind, std::max<std::uint64_t>(cost.part_pairs, 1)};
}

/// Groups queries by size in steps of a factor of four, as the start dominates small ones.
std::uint32_t Forecast::index(const Work& work) {
  const auto size = static_cast<std::uint32_t>(std::bit_width(work.part_pairs)) / 2;
  return std::min(work.kind, kKinds - 1) * kSizes + std::min(size, kSizes - 1);
}

void Forecast::note(const Work& work, std::chrono::nanoseconds took, bool is_whole) {
  double& figure = ns_per_part_pair_[index(work)];
  double seen = static_cast<double>(took.count()) / static_cast<double>(work.part_pairs);
  if (!is_whole) seen *= kGivenUp;
  if (figure > 0) seen = std::min(seen, kMostRise * figure);
  if (!is_whole)
    figure = std::max(figure, seen);
  else
    figure = figure > 0 ? figure + kNewest * (seen - figure) : seen;
}

std::optional<std::chrono::nanoseconds> Forecast::of(const Work& work) const {
  const double figure = ns_per_part_pair_[index(work)];
  if (figure <= 0) return std::nullopt;
  const double ns = std::min(figure * static_cast<double>(work.part_pairs), 9e18);
  return std::chrono::nanoseconds(static_cast<std::int64_t>(ns));
}

void Forecast::check(const Work& work, std::chrono::nanoseconds left, std::chrono::nanoseconds deadline) {
  const auto takes = of(work);
  if (!takes || *takes <= left) return;
  ns_per_part_pair_[index(work)] *= kAfterRejection;
  throw late(deadline, "it would take about " + ms(*takes) + ", based on similar queries");
}

RejectedRequest deadline_passed(std::chrono::nanoseconds deadline, std::chrono::nanoseconds worked) {
  if (worked.count() == 0) return late(deadline, "it was waiting, or its pairs were still being listed");
  return late(deadline, "it was given up after " + ms(worked) + " of work");
}

}  // namespace clearance
