// Bounds of distances by covers: of pairs of balls, and of balls and shapes of every kind, fixed or carried by a link.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "tests/oracle/decision/among_shapes.h"
#include "tests/oracle/decision/pair_query.h"

namespace clearance::exact {
namespace {

/// Pairs whose bounds are narrow, and those that are left.
struct Found {
  int narrow = 0, left = 0, overlap = 0;
};

/// A state, and the exact distances of some pairs in it.
struct State {
  const BallScene& made;
  const std::vector<BodyPair>& pairs;
  std::vector<double> distance = {};

  State(const BallScene& of, const std::vector<BodyPair>& some, std::span<const double> q) : made(of), pairs(some) {
    const std::vector<test::RealFrame> frames = made.frames(q);
    for (const BodyPair pair : pairs) distance.push_back(made.distance(pair, frames));
  }
  /// Greatest lower bound that a pair may have.
  double most(std::size_t pair) const { return std::max(distance[pair] - made.uncertainty(pairs[pair]), 0.0); }
};

// Expects the exact distance of each pair in its interval.
void expect_each(const State& state, const std::vector<DistanceBounds>& bounds, double abs_tol, Found& found) {
  ASSERT_EQ(bounds.size(), state.pairs.size());
  for (std::size_t p = 0; p < bounds.size(); ++p) {
    const double d = state.distance[p];
    const bool is_left = bounds[p].left_begin < bounds[p].left_end;
    ASSERT_TRUE(bounds[p].is_listed);
    if (d > 0) {
      EXPECT_GE(bounds[p].upper, d) << p;
    }
    found.overlap += bounds[p].upper <= 0;
    found.left += is_left;
    if (is_left || bounds[p].upper <= 0) continue;
    ++found.narrow;
    EXPECT_LE(bounds[p].lower, state.most(p)) << p;
    EXPECT_LE(bounds[p].upper - bounds[p].lower, abs_tol) << p;
  }
}

/// The bounds on the least distance of a state.
struct Least {
  DistanceBounds bounds;
  std::vector<LeftPair> left;

  bool is_narrow() const { return left.empty() && bounds.upper > 0; }
};

// Expects the exact distances of all pairs in the bounds on the least one.
Least expect_least(const State& state, PairQuery& query, double abs_tol) {
  const CoverBounds::Room room = query.least_distance(abs_tol);
  const DistanceBounds& bounds = room.bounds.at(0);
  EXPECT_TRUE(bounds.is_listed);
  const std::span left = std::span(room.left).subspan(bounds.left_begin, bounds.left_end - bounds.left_begin);
  const double least = *std::min_element(state.distance.begin(), state.distance.end());
  if (bounds.upper <= 0) {
    EXPECT_LE(least, 0);
    return {bounds, {left.begin(), left.end()}};
  }
  EXPECT_GE(bounds.upper, least);
  EXPECT_GE(bounds.upper, state.distance.at(bounds.upper_at));
  for (std::size_t p = 0; p < state.pairs.size(); ++p)
    if (std::none_of(left.begin(), left.end(), [&](const LeftPair& pair) { return pair.position == p; })) {
      EXPECT_LE(bounds.lower, state.most(p)) << p;
    }
  if (left.empty()) {
    EXPECT_LE(bounds.upper - bounds.lower, abs_tol);
  }
  return {bounds, {left.begin(), left.end()}};
}

// Expects the exact distances of pairs in their intervals at random states.
void bound_at_random(const BallScene& made, const std::vector<BodyPair>& pairs, double abs_tol, int count,
                     std::mt19937_64 seed, Found& found, const JointTableStore* tables = nullptr) {
  Random random(seed());
  for (int n = 0; n < count; ++n) {
    const std::vector<double> q = random_positions(made, random);
    PairQuery query(made, pairs, q, 0, false, tables);
    expect_each(State(made, pairs, q), query.distances(abs_tol), abs_tol, found);
  }
}

TEST(DistanceBounds, PairsOfBallsHaveTheirDistance) {
  const BallScene single = made_arm(1, 0.0625, with_slack()), several = made_arm(60, 0.015625, with_slack());
  Found one, many;
  bound_at_random(single, pairs_of(single), 0.02, 100, std::mt19937_64(1), one);
  for (const double abs_tol : {0.02, 0.05, 0.2})
    bound_at_random(several, pairs_of(several), abs_tol, 60, std::mt19937_64(2), many);
  std::printf("one ball: %d narrow, %d left, %d overlap; 60: %d, %d, %d\n", one.narrow, one.left, one.overlap,
              many.narrow, many.left, many.overlap);
  EXPECT_GT(one.narrow, 200);
  EXPECT_GT(std::min(one.overlap, many.overlap), 0);
  EXPECT_GT(std::min(many.narrow, many.left), 50);
}

// Boxes of the obstacles leave out those that are far.
TEST(DistanceBounds, TheLeastOfManyPairsIsInItsInterval) {
  BallScene made = made_arm(60, 0.015625, with_slack());
  Random random(12);
  std::vector<BodyPair> pairs;
  for (int n = 0; n < 12; ++n) {
    const std::uint32_t obstacle =
        made.add_obstacle({{{0, 0, 0}, random.uniform(0.01, 0.1)}},
                          random.rotation(Vec3d{1, 2, 0.5} + random.direction() * random.uniform(1, 3)));
    for (const std::size_t link : {1u, 3u, 4u}) pairs.push_back({made.link(link), obstacle});
  }
  int narrow = 0, left = 0;
  for (const double abs_tol : {0.002, 0.1, 0.3})
    for (int n = 0; n < 60; ++n) {
      const std::vector<double> q = random_positions(made, random);
      PairQuery query(made, pairs, q, 0);
      const Least least = expect_least(State(made, pairs, q), query, abs_tol);
      narrow += least.is_narrow();
      left += !least.left.empty();
    }
  std::printf("%d narrow, %d left\n", narrow, left);
  EXPECT_GT(narrow, 30);
  EXPECT_GT(left, 5);
}

// The links 1 to 20, of one ball each: more bodies than columns that are compared side by side.
BallScene made_chain() {
  std::vector<BallLink> links{{}};
  for (std::uint32_t l = 0; l < 20; ++l)
    links.push_back(
        {{{{0.0625, 0, 0}, 0.03125}}, l, turning({0.125, 0, 0}, l % 2 == 0 ? Vec3d{0, 1, 0.25} : Vec3d{0.25, 0, 1})});
  engine::RobotOptions options;
  options.base = Pose{{1, 2, 0.5}, 0.5, 0.5, -0.5, 0.5};
  return BallScene(links, options);
}

// The links 1 to 4, of many balls.
BallScene made_bulky() {
  Random random(8);
  const auto shape = [&] { return random_balls(random, 40, 0.125, 0.03125); };
  return BallScene({{},
                    {shape(), 0, turning({0, 0, 0.25}, {0.25, 0, 1})},
                    {shape(), 1, sliding({0.375, 0, 0}, {1, 0.25, 0}, -0.125, 0.25)},
                    {shape(), 2, turning({0.375, 0, 0}, {0, 1, 0.25})},
                    {shape(), 3, turning({0.375, 0, 0.125}, {1, 0.5, 0})}},
                   with_slack());
}

std::vector<std::size_t> first_kinds(std::size_t count) {
  std::vector<std::size_t> kinds(count);
  std::iota(kinds.begin(), kinds.end(), std::size_t{0});
  return kinds;
}

// The gaps of roots alone are narrow enough, once those that boxes do not leave out are compared.
TEST(DistanceBounds, RootsOfSingleBallsLeaveNoPair) {
  const BallScene chain = made_chain();
  Random random(31);
  int narrow = 0, ties = 0;
  std::array<int, 3> of_columns{};  // with the nearest body in columns 0 to 7, 8 to 15, 16 to 19
  for (int n = 0; n < 200; ++n) {
    const AmongShapes of(chain, 20, random_positions(chain, random), first_kinds(kExactGaps), false, random);
    PairQuery query(of.made, of.pairs, of.positions, 0);
    const State state(of.made, of.pairs, of.positions);
    const Least least = expect_least(state, query, 0.02);
    if (least.bounds.upper <= 0) continue;
    EXPECT_TRUE(least.left.empty()) << n;
    EXPECT_EQ(least.bounds.packets, 0u) << n << ": all roots that boxes do not leave out are compared";
    ++narrow;
    std::vector<double> ordered = state.distance;
    std::nth_element(ordered.begin(), ordered.begin() + 1, ordered.end());
    ties += ordered[1] - ordered[0] < 1e-4;
    const auto nearest = std::min_element(state.distance.begin(), state.distance.end()) - state.distance.begin();
    ++of_columns[query.index_of(of.pairs[static_cast<std::size_t>(nearest)].a) / 8];
  }
  std::printf("%d narrow, %d ties, %d, %d and %d by columns\n", narrow, ties, of_columns[0], of_columns[1],
              of_columns[2]);
  EXPECT_GT(narrow, 150);
  EXPECT_GT(ties, 20);
  EXPECT_GT(*std::min_element(of_columns.begin(), of_columns.end()), 20);
}

// Least distances and those of each pair, among obstacles and carried bodies of every kind.
TEST(DistanceBounds, ShapesOfEveryKindHaveTheirDistance) {
  const BallScene chain = made_chain(), bulky = made_bulky();
  const std::size_t kinds = near_shapes().size();
  Random random(32);
  std::vector<int> narrow(kinds), left(kinds);  // states, by kind of the pair with the upper bound, and of those left
  int carried = 0;
  Found each;
  for (std::size_t n = 0; n < 15 * kinds; ++n) {
    const bool is_chain = n % 2 == 0;
    const BallScene& robot = is_chain ? chain : bulky;
    // All kinds, or three of one.
    const AmongShapes of(robot, is_chain ? 20 : 4, random_positions(robot, random),
                         n % 3 == 0 ? first_kinds(kinds) : std::vector<std::size_t>(3, n / 3 % kinds), n % 4 >= 2,
                         random);
    PairQuery query(of.made, of.pairs, of.positions, 0);
    const State state(of.made, of.pairs, of.positions);
    for (const double abs_tol : {0.002, 0.03, 0.1}) {
      const Least least = expect_least(state, query, abs_tol);
      for (const LeftPair& pair : least.left) ++left[of.kind_of[pair.position]];
      narrow[of.kind_of[least.bounds.upper_at]] += least.is_narrow();
      carried += least.is_narrow() && of.is_carried[least.bounds.upper_at];
      expect_each(state, query.distances(abs_tol), abs_tol, each);
    }
  }
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    std::printf("%-10s %3d narrow, %3d left\n", near_shapes()[kind].name, narrow[kind], left[kind]);
    EXPECT_GT(narrow[kind], 3) << near_shapes()[kind].name;
    EXPECT_GT(left[kind], 3) << near_shapes()[kind].name;
  }
  std::printf("%d narrow with a carried body; pairs: %d narrow, %d left\n", carried, each.narrow, each.left);
  EXPECT_GT(carried, 20);
  EXPECT_GT(std::min(each.narrow, each.left), 1000);
}

TEST(DistanceBounds, PairsOfTablesHaveTheirDistance) {
  const BallScene made = made_folding();
  const auto tables = tables_of(made);
  Found found;
  bound_at_random(made, {{made.link(1), made.link(3)}}, 0.02, 300, std::mt19937_64(3), found, tables.get());
  EXPECT_GT(found.narrow, 100);
}

}  // namespace
}  // namespace clearance::exact
