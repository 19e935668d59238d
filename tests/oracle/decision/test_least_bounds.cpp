// Bounds of distances by covers: of a group of pairs as its search goes on, and of pairs of balls.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "tests/oracle/decision/pair_query.h"

#define CLEARANCE_ISA least_bounds_test
#include "engine/decision/kernel/least_bounds.h"

namespace clearance::exact {
namespace {

using least_bounds_test::Bits;
using least_bounds_test::Eight;
using least_bounds_test::LeastBounds;

struct Search {
  DistanceLimits limits{.scale = {1, 1}, .shift = {-0.125, -0.125}, .any_overlap = true};
  std::vector<LeftPair> left{8};
  DistanceRoom room{nullptr, left.data(), 8, nullptr, nullptr};
  LeastBounds least{limits, room};

  DistanceBounds end() {
    DistanceBounds result;
    least.end(result);
    return result;
  }
};

TEST(LeastBounds, PairsLeftThatAreFarByTheEndCountAsLaidAside) {
  Search search;
  search.least.begin(0);
  search.least.take_upper(1.0f, 0);
  search.least.leave(3, 0.75f);
  search.least.leave(4, 0.8125f);
  search.least.take_upper(0.8125f, 1);
  const DistanceBounds found = search.end();
  ASSERT_TRUE(found.is_listed);
  EXPECT_EQ(found.left_begin, found.left_end) << "both are beyond 0.8125 - 0.125";
  EXPECT_LE(found.lower, 0.75);
  EXPECT_GT(found.lower, 0.749);
  EXPECT_EQ(found.lower_at, 3u);
  EXPECT_EQ(found.upper_at, 1u);
}

TEST(LeastBounds, PairsBeyondTheGreatestThresholdNeedNoUpperBound) {
  Search search;
  search.limits.most = 0.5;
  EXPECT_GE(search.least.greatest_threshold(), 0.5f);
  EXPECT_LT(search.least.greatest_threshold(), 0.501f);
  search.least.begin(0);
  search.least.take_upper(LeastBounds::kFar - 1, 2);  // of a root that a cloud's search did not reach
  search.least.lay_aside(0.75f, 3);
  const DistanceBounds found = search.end();
  ASSERT_TRUE(found.is_listed);
  EXPECT_EQ(found.left_begin, found.left_end);
  EXPECT_LE(found.lower, 0.75);
  EXPECT_GT(found.lower, 0.749);
  EXPECT_EQ(found.upper, std::numeric_limits<double>::infinity());
  EXPECT_EQ(found.upper_at, 3u);
}

TEST(LeastBounds, PairsAfterAnOverlappingOneAreNotLeft) {
  Search search;
  search.limits.any_overlap = false;
  search.least.begin(0);
  search.least.leave(2, -1.0f);
  search.least.leave(6, -1.0f);
  search.least.take_upper(-0.5f, 4);
  const DistanceBounds found = search.end();
  ASSERT_EQ(found.left_end - found.left_begin, 1u);
  EXPECT_EQ(search.left[0].position, 2u);
  EXPECT_EQ(found.upper_at, 4u);
}

/// For each pair, the least lower bound of its shares that were laid aside or left.
struct Shares {
  std::map<std::uint64_t, double> least;

  void add(std::uint64_t position, double lower) {
    const auto [it, is_new] = least.emplace(position, lower);
    if (!is_new) it->second = std::min(it->second, lower);
  }
};

// Random shares of pairs: each is no nearer than the bound found, or its pair is left.
TEST(LeastBounds, EveryShareIsLeftOrNoNearerThanTheLowerBound) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> any(0.5f, 2.0f);
  int dropped = 0, left = 0;
  for (int n = 0; n < 2000; ++n) {
    Search search;
    search.least.begin(0);
    Shares shares;
    double upper = std::numeric_limits<double>::infinity();
    for (int step = 0; step < 6; ++step) {
      alignas(32) float lower[8], values[8];
      for (float& value : lower) value = any(random);
      const auto position = [](int i) { return static_cast<std::uint64_t>(i); };
      for (int i = 0; i < 8; ++i) shares.add(position(i), lower[i]);
      const Bits open = search.least.sift(Eight::load(lower), 0xff, values, position);
      for (int i = 0; i < 8; ++i)
        if (open >> i & 1) search.least.leave(position(i), lower[i]);
      alignas(32) float high[8];
      for (float& value : high) value = 0.6f + any(random);
      search.least.take_upper(Eight::load(high), 0xff, position);
      upper = std::min(upper, double{*std::min_element(high, high + 8)});
    }
    const DistanceBounds found = search.end();
    ASSERT_TRUE(found.is_listed);
    EXPECT_GE(found.upper, upper);
    for (const auto& [position, lower] : shares.least) {
      bool is_left = false;
      for (std::uint32_t i = found.left_begin; i < found.left_end; ++i) is_left |= search.left[i].position == position;
      left += is_left;
      dropped += !is_left;
      EXPECT_TRUE(is_left || found.lower <= lower) << position;
      EXPECT_TRUE(is_left || found.lower >= found.upper - 0.126) << "narrow enough";
    }
  }
  EXPECT_GT(left, 1000);
  EXPECT_GT(dropped, 1000);
}

/// Pairs whose bounds are narrow, and those that are left.
struct Found {
  int narrow = 0, left = 0, overlap = 0;
};

// Expects the exact distances of pairs in their intervals at random states.
void bound_at_random(const BallScene& made, const std::vector<BodyPair>& pairs, double abs_tol, int count,
                     std::mt19937_64 seed, Found& found, const JointTableStore* tables = nullptr) {
  Random random(seed());
  for (int n = 0; n < count; ++n) {
    const std::vector<double> q = random_positions(made, random);
    PairQuery query(made, pairs, q, 0, false, tables);
    const std::vector<test::RealFrame> frames = made.frames(q);
    const std::vector<DistanceBounds> bounds = query.distances(abs_tol);
    ASSERT_EQ(bounds.size(), pairs.size());
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const double d = made.distance(pairs[p], frames), slack = made.uncertainty(pairs[p]);
      const bool is_left = bounds[p].left_begin < bounds[p].left_end;
      ASSERT_TRUE(bounds[p].is_listed);
      if (d > 0) {
        EXPECT_GE(bounds[p].upper, d) << p;
      }
      found.overlap += bounds[p].upper <= 0;
      found.left += is_left;
      if (is_left || bounds[p].upper <= 0) continue;
      ++found.narrow;
      EXPECT_LE(bounds[p].lower, std::max(d - slack, 0.0)) << p;
      EXPECT_LE(bounds[p].upper - bounds[p].lower, abs_tol) << p;
    }
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
  int narrow = 0, left = 0, overlap = 0;
  for (const double abs_tol : {0.002, 0.1, 0.3})
    for (int n = 0; n < 60; ++n) {
      const std::vector<double> q = random_positions(made, random);
      const std::vector<test::RealFrame> frames = made.frames(q);
      const CoverBounds::Room found = PairQuery(made, pairs, q, 0).least_distance(abs_tol);
      ASSERT_EQ(found.bounds.size(), 1u);
      const DistanceBounds& bounds = found.bounds[0];
      ASSERT_TRUE(bounds.is_listed);
      overlap += bounds.upper <= 0;
      if (bounds.upper <= 0) continue;
      const auto first = found.left.begin() + bounds.left_begin, last = found.left.begin() + bounds.left_end;
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t p = 0; p < pairs.size(); ++p) {
        const double d = made.distance(pairs[p], frames);
        least = std::min(least, d);
        if (std::none_of(first, last, [&](const LeftPair& pair) { return pair.position == p; })) {
          EXPECT_LE(bounds.lower, std::max(d - made.uncertainty(pairs[p]), 0.0)) << p;
        }
      }
      EXPECT_GE(bounds.upper, least);
      left += first != last;
      narrow += first == last;
      if (first == last) {
        EXPECT_LE(bounds.upper - bounds.lower, abs_tol);
      }
    }
  std::printf("%d narrow, %d left, %d overlap\n", narrow, left, overlap);
  EXPECT_GT(narrow, 30);
  EXPECT_GT(left, 5);
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
