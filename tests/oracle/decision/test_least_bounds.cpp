// Bounds on the least distance of a group of pairs, as the search by covers goes on.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <random>
#include <vector>

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
      const Bits open = search.least.sift(Eight::load(lower), values, position);
      for (int i = 0; i < 8; ++i)
        if (open >> i & 1) search.least.leave(position(i), lower[i]);
      alignas(32) float high[8];
      for (float& value : high) value = 0.6f + any(random);
      search.least.take_upper(Eight::load(high), position);
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

}  // namespace
}  // namespace clearance::exact
