// Counters of the daemon, without a loop.
#include <gtest/gtest.h>

#include <future>
#include <map>
#include <thread>

#include "server/base/stats.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;

std::map<std::string, std::uint64_t> all_of(const Stats& stats) {
  Stats::Named list;
  stats.append_to(list);
  return {list.begin(), list.end()};
}

TEST(Stats, LatenciesAreCountedInPowersOfTwo) {
  Stats stats;
  for (const std::uint64_t ns : {0, 1, 1000}) stats.count_latency(ns);
  for (const std::uint64_t ns : {1001, 2000}) stats.count_latency(ns);
  stats.count_latency(2001);
  stats.count_latency(std::uint64_t{1} << 50);
  const auto all = all_of(stats);
  EXPECT_EQ(all.at("latency_us.1"), 3u);
  EXPECT_EQ(all.at("latency_us.2"), 2u);
  EXPECT_EQ(all.at("latency_us.4"), 1u);
  EXPECT_EQ(all.at("latency_us.8"), 0u);
  EXPECT_EQ(all.at("latency_us.more"), 1u);
  EXPECT_EQ(all.at("queries.latency_sum_ns"), 6003u + (std::uint64_t{1} << 50));
}

TEST(Stats, ErrorsAreCountedByCodeAndRemembered) {
  Stats stats;
  stats.count_error("busy", "3 queries");
  stats.count_error("busy", "4 queries");
  EXPECT_EQ(stats["errors"], 2u);
  EXPECT_EQ(stats["errors.busy"], 2u);
  auto reader = std::async(std::launch::async, [&] { return stats.read(1h, [] {}); });
  while (!stats.are_wanted()) std::this_thread::yield();
  stats.hand_out({{"errors", stats["errors"]}});
  const auto metrics = reader.get();
  ASSERT_TRUE(metrics);
  EXPECT_EQ(metrics->counters, (Stats::Named{{"errors", 2}}));
  ASSERT_EQ(metrics->errors.size(), 1u);
  EXPECT_EQ(metrics->errors[0].text, "4 queries") << "of one kind, the last";
  EXPECT_EQ(metrics->errors[0].count, 2u);
}

TEST(Stats, ALoopThatHandsOutNothingIsNotWaitedForForever) {
  Stats stats;
  bool woken = false;
  EXPECT_FALSE(stats.read(1ms, [&] { woken = true; }));
  EXPECT_TRUE(woken);
  EXPECT_TRUE(stats.are_wanted());
}

}  // namespace
}  // namespace clearance
