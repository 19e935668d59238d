// Rounds of motions, decided with covers, without them, and by exact arithmetic at some times.
#include <algorithm>
#include <array>
#include <cmath>

#include "tests/engine/engine_test_util.h"
#include "tests/oracle/states/state_oracle.h"
#include "tests/oracle/states/state_round.h"

namespace clearance::exact {
namespace {

constexpr std::uint32_t kMostEvaluations = 512;

std::vector<double> state_at(std::span<const double> start, std::span<const double> end, double time) {
  std::vector<double> q;
  for (std::size_t j = 0; j < start.size(); ++j) q.push_back(start[j] + time * (end[j] - start[j]));
  return q;
}

bool is_known(const Body& body) {
  return !is_cloud(body) && std::none_of(body.parts.begin(), body.parts.end(),
                                         [](const ConvexPartPtr& part) { return part->surface != nullptr; });
}

}  // namespace

// Pairs without bodies that covers do not know and that are far away: with one of these, covers decide no motion.
std::vector<BodyPair> StateOracle::pairs_of_motions(const QueryView& query) const {
  std::vector<BodyPair> pairs = with_.pairs(for_pairs(query));
  const auto is_left_out = [&](std::uint32_t body) {
    return !is_known(made_.scene.bodies()[body]) && std::find(placed_.begin(), placed_.end(), body) == placed_.end();
  };
  std::erase_if(pairs, [&](BodyPair pair) { return is_left_out(pair.a) || is_left_out(pair.b); });
  return pairs;
}

// Motions of 0.05 to 3 rad, some of one joint or two. Near ones pass through one state, each at a time of its own.
void StateOracle::add_motions(Round& round, Random& random) {
  round.count = round.is_close() ? 4 : 8;
  for (std::size_t m = 0; m < round.count; ++m) {
    const std::vector<double> q = round.kind == StateKind::kUniform ? uniform_state(random) : round.through;
    const double share = random.chance(0.5) ? 1 : random.uniform(0, 1);  // of joints that move
    std::vector<double> change;
    double length = 0;
    for (std::size_t j = 0; j < q.size(); ++j) {
      change.push_back(random.chance(share) ? random.normal() : 0);
      length += change.back() * change.back();
    }
    const double scale = random.log_uniform(0.05, 3) / std::sqrt(std::max(length, 1e-9));
    const double time = random.chance(0.25) ? random.integer(0, 8) / 8.0 : random.uniform(0, 1);
    round.times.push_back(time);
    for (const double at : {-time, 1 - time})
      for (std::size_t j = 0; j < q.size(); ++j) round.positions.push_back(q[j] + at * scale * change[j]);
  }
}

void StateOracle::round_of_motions(StateKind kind, std::size_t margin, Random& random, StateTally& tally) {
  Round round{.kind = kind, .margin = kStateMargins[margin], .margin_index = margin};
  place_obstacles(round, random);
  add_motions(round, random);
  compare_round(round, random, tally, &StateOracle::compare_motions);
}

void StateOracle::compare_motions(const Round& round, Random& random, StateTally& tally) {
  QueryView query = query_of(joints_, round.positions, round.margin);
  query.max_evaluations = kMostEvaluations;
  query.fields = kFieldVerdict;
  const std::vector<BodyPair> pairs = pairs_of_motions(query);
  query.all_pairs = false;
  query.pairs = pairs;
  const std::vector<MarginEntry> entries = some_margins(round, random, query);
  const test::Answer expected = test::evaluate(without_, query), found = test::evaluate(with_, query);
  tally.pairs += static_cast<std::int64_t>(expected.info.pairs_evaluated);
  tally.open += static_cast<std::int64_t>(found.info.pairs_evaluated);
  count(round, expected.view, found.view, tally);
  const auto chosen = static_cast<std::size_t>(random.integer(0, static_cast<int>(round.count) - 1));
  if (entries.empty() && !round.is_attached && made_.has_oracle())
    solve_motion(round, query, chosen, static_cast<Status>(found.view.verdict[chosen]), random, tally);
  if (random.chance(0.125)) compare_alone(query, found.view, tally);
}

// A motion has the same verdict alone.
void StateOracle::compare_alone(const QueryView& batch, const ReplyView& all, StateTally& tally) {
  QueryView query = batch;
  const std::size_t width = 2 * joints_.size(), motions = batch.positions.size() / width;
  query.configuration_count = 2;
  for (std::size_t m = 0; m < motions; ++m) {
    query.positions = batch.positions.subspan(m * width, width);
    tally.other_bits += test::evaluate(with_, query).view.verdict[0] != all.verdict[m];
  }
}

// A free motion is free at every time. A hit has a time within the margin, which the exact engine names: a motion
// that it leaves undecided has none, and is not checked.
void StateOracle::solve_motion(const Round& round, const QueryView& batch, std::size_t motion, Status verdict,
                               Random& random, StateTally& tally) {
  if (!is_decided(verdict)) return;
  const std::size_t width = joints_.size();
  const auto start = batch.positions.subspan(2 * motion * width, width);
  const auto end = batch.positions.subspan((2 * motion + 1) * width, width);
  std::vector<double> times = {round.times[motion], 0, 1, random.uniform(0, 1)};
  if (is_hit(verdict)) {
    QueryView query = batch;
    query.positions = batch.positions.subspan(2 * motion * width, 2 * width);
    query.configuration_count = 2;
    query.fields = kFieldVerdict | kFieldStatus | kFieldTime;
    const test::Answer answer = test::evaluate(without_, query);
    times = {answer.view.time[0]};
    if (!is_hit(static_cast<Status>(answer.view.verdict[0])) || !std::isfinite(times[0])) return;
  }
  ++tally.exact;
  tally.untrue += std::any_of(times.begin(), times.end(),
                              [&](double time) { return is_contradicted(batch, state_at(start, end, time), verdict); });
}

}  // namespace clearance::exact
