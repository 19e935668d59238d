// Rounds of distances to a tolerance: with covers, without them to the last digits, and by exact arithmetic.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/engine/engine_test_util.h"
#include "tests/oracle/states/exact_state.h"
#include "tests/oracle/states/state_oracle.h"
#include "tests/oracle/states/state_round.h"

namespace clearance::exact {
namespace {

constexpr double kMostContact = 1e-6;  // metres, width of a contact at any tolerance
constexpr double kDigits = 1e-9;       // metres, more than the width of the exact engine's intervals

bool is(const ReplyView& view, std::uint64_t row, Status status) {
  return view.status[row] == static_cast<std::uint8_t>(status);
}

// Whether an interval to a tolerance does not hold the exact engine's, or its status contradicts that: without
// max_distance, only groups without points are beyond it.
bool is_wrong(const ReplyView& exact, const ReplyView& found, std::uint64_t row) {
  const double lower = found.lower[row], upper = found.upper[row];
  if (std::isnan(found.distance[row]) || is(found, row, Status::kBeyond) != is(exact, row, Status::kBeyond))
    return true;
  const bool is_exact = !is(exact, row, Status::kUnconverged);
  // The upper bound of a contact depends on the points found, within the slack of its bodies.
  const bool is_narrow = is_exact && !is(exact, row, Status::kContact);
  if (is_narrow && (lower > exact.lower[row] + kDigits || upper < exact.upper[row] - kDigits)) return true;
  if (lower > exact.upper[row] || upper < exact.lower[row]) return true;
  if (is(exact, row, Status::kOverlap)) return !is(found, row, Status::kOverlap);
  if (is(found, row, Status::kOverlap)) return is_exact;
  return is(exact, row, Status::kOk) && is(found, row, Status::kContact) && upper > kMostContact;
}

// Whether an interval is wider than a tolerance without slack as its reason.
bool is_wider(const ReplyView& exact, const ReplyView& found, std::uint64_t row, double tolerance) {
  if (is(found, row, Status::kUnconverged)) return !is(exact, row, Status::kUnconverged);
  if (!is(found, row, Status::kOk) || (found.flags[row] & kFlagUncertaintyLimited)) return false;
  return found.upper[row] - found.lower[row] > tolerance;
}

// Whether a row has a distance, and another one has none or a longer one.
bool is_nearer_row(const ReplyView& found, std::uint64_t row, std::uint64_t other) {
  return !(found.upper[row] >= found.upper[other]);
}

bool has_surface_or_cloud(const Body& body) {
  return is_cloud(body) || std::any_of(body.parts.begin(), body.parts.end(),
                                       [](const ConvexPartPtr& part) { return part->surface != nullptr; });
}

}  // namespace

void DistanceTally::add(const DistanceTally& o) {
  count += o.count, rows += o.rows, apart += o.apart, overlap += o.overlap, contact += o.contact;
  wrong += o.wrong, wider += o.wider, exact += o.exact, untrue += o.untrue, surfaces += o.surfaces,
      carried += o.carried;
  pairs += o.pairs, evaluated += o.evaluated;
}

std::string DistanceTally::text() const {
  char text[300];
  const auto n = [](std::int64_t number) { return static_cast<long long>(number); };
  std::snprintf(
      text, sizeof text,
      "%lld states, %lld rows (%lld apart, %lld overlapping, %lld contacts): %lld wrong, %lld wider; %lld of "
      "%lld contradict the oracle, %lld of surfaces alone, %lld with an obstacle carried; exact pairs %lld -> %lld",
      n(count), n(rows), n(apart), n(overlap), n(contact), n(wrong), n(wider), n(untrue), n(exact), n(surfaces),
      n(carried), n(pairs), n(evaluated));
  return text;
}

// Pairs with bodies that the robot moves: all of them, or those of one with an obstacle that is there.
std::vector<BodyPair> StateOracle::pairs_of_states(const QueryView& query, bool of_world) const {
  const std::vector<Body>& bodies = made_.scene.bodies();
  const auto moves = [&](std::uint32_t b) { return bodies[b].robot != kNone || with_.body_state(b).parent != kNone; };
  const auto is_there = [&](std::uint32_t b) {
    return bodies[b].is_static || std::find(placed_.begin(), placed_.end(), b) != placed_.end();
  };
  std::vector<BodyPair> pairs = with_.pairs(for_pairs(query));
  std::erase_if(pairs, [&](BodyPair p) {
    if (!moves(p.a) && !moves(p.b)) return true;
    return of_world && (moves(p.a) == moves(p.b) || !is_there(moves(p.a) ? p.b : p.a));
  });
  return pairs;
}

void StateOracle::round_of_distances(StateKind kind, std::size_t tolerance, Random& random, DistanceTally& tally) {
  constexpr Reduce kReduces[] = {Reduce::kMin, Reduce::kNearest, Reduce::kNone};
  Round round{.kind = kind, .margin = 0, .margin_index = 0};
  place_obstacles(round, random);
  attach_some(round, random);
  add_states(round, random);
  QueryView query = query_of(joints_, round.positions, 0);
  const std::vector<BodyPair> pairs = pairs_of_states(query, random.chance(0.75));
  query.all_pairs = false;
  query.pairs = pairs;
  query.reduce = kReduces[random.integer(0, 2)];
  query.fields = kDefaultFields | kFieldFlags;
  query.rel_tol = 1e-12;
  const test::Answer exact = test::evaluate(without_, query);
  query.rel_tol = 0;
  query.abs_tol = kDistanceTolerances[tolerance];
  test::evaluate(with_, query);  // covers may pay from the second answer on a snapshot on
  const test::Answer found = test::evaluate(with_, query);
  tally.count += static_cast<std::int64_t>(round.count);
  tally.pairs += static_cast<std::int64_t>(exact.info.pairs_evaluated);
  tally.evaluated += static_cast<std::int64_t>(found.info.pairs_evaluated);
  for (std::uint64_t row = 0; row < found.size.rows; ++row) {
    if (std::isnan(exact.view.distance[row])) {
      tally.wrong += found.view.status[row] != exact.view.status[row];
      continue;
    }
    ++tally.rows;
    tally.apart += is(found.view, row, Status::kOk);
    tally.overlap += is(found.view, row, Status::kOverlap);
    tally.contact += is(found.view, row, Status::kContact);
    tally.wrong += is_wrong(exact.view, found.view, row);
    tally.wider += is_wider(exact.view, found.view, row, query.abs_tol);
  }
  if (made_.has_oracle()) solve_distance(query, found.view, round.is_attached ? placed_.back() : kNone, random, tally);
  end(round);
}

// Compares some rows of one state with the oracle: the least distance, or the nearest of a few rows.
void StateOracle::solve_distance(const QueryView& query, const ReplyView& found, std::uint32_t carried, Random& random,
                                 DistanceTally& tally) const {
  constexpr int kDraws = 8;
  const std::vector<Body>& bodies = made_.scene.bodies();
  const std::size_t groups = query.reduce == Reduce::kMin    ? 1
                             : query.reduce == Reduce::kNone ? query.pairs.size()
                                                             : bodies.size();
  const auto state = static_cast<std::size_t>(random.integer(0, static_cast<int>(query.configuration_count) - 1));
  std::size_t group = 0;
  for (int n = 0; n < kDraws; ++n) {
    const auto drawn = static_cast<std::size_t>(random.integer(0, static_cast<int>(groups) - 1));
    if (n == 0 || is_nearer_row(found, state * groups + drawn, state * groups + group)) group = drawn;
  }
  // Of these, those of a carried obstacle come first.
  const auto is_of_carried = [&](BodyPair p) { return p.a == carried || p.b == carried; };
  if (carried != kNone && query.reduce == Reduce::kNearest) group = carried;
  if (carried != kNone && query.reduce == Reduce::kNone)
    for (std::size_t p = 0; p < groups; ++p)
      if (is_of_carried(query.pairs[p]) &&
          (!is_of_carried(query.pairs[group]) || is_nearer_row(found, state * groups + p, state * groups + group)))
        group = p;
  const std::uint64_t row = state * groups + group;
  if (std::isnan(found.distance[row]) || std::isinf(found.upper[row])) return;
  std::vector<BodyPair> pairs(query.pairs.begin(), query.pairs.end());
  if (query.reduce == Reduce::kNone) pairs = {pairs[group]};
  if (query.reduce == Reduce::kNearest) std::erase_if(pairs, [&](BodyPair p) { return p.a != group && p.b != group; });
  const std::vector<PlacedBody> placed =
      placed_bodies(made_, with_, query.positions.subspan(state * joints_.size(), joints_.size()));
  const bool is_lower_wrong = found.lower[row] > 0 && std::any_of(pairs.begin(), pairs.end(), [&](BodyPair p) {
                                return is_nearer(placed[p.a], placed[p.b], found.lower[row]);
                              });
  const bool is_upper_wrong = std::all_of(
      pairs.begin(), pairs.end(), [&](BodyPair p) { return is_farther(placed[p.a], placed[p.b], found.upper[row]); });
  ++tally.exact;
  tally.carried += std::any_of(pairs.begin(), pairs.end(), is_of_carried);
  tally.untrue += is_lower_wrong || is_upper_wrong;
  tally.surfaces += std::all_of(pairs.begin(), pairs.end(), [&](BodyPair p) {
    return (has_surface_or_cloud(bodies[p.a]) || has_surface_or_cloud(bodies[p.b])) && !placed[p.a].parts.empty() &&
           !placed[p.b].parts.empty();
  });
}

DistanceTable compare_distances(StateOracle& oracle, std::int64_t count, std::uint64_t seed) {
  return compare_rounds<DistanceTable>(count, seed,
                                       [&](auto&&... of_round) { oracle.round_of_distances(of_round...); });
}

}  // namespace clearance::exact
