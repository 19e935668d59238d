// Arithmetic of the benchmark: percentiles, and latencies at a fixed rate.
#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "bench/latency/bench_samples.h"

namespace clearance::cli {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

TEST(BenchSamples, PercentilesAreTheNearestRank) {
  Samples samples;
  EXPECT_TRUE(std::isnan(samples.percentile_us(0.5)));
  std::vector<std::int64_t> values(1000);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::int64_t>(1000 * (i + 1));
  std::shuffle(values.begin(), values.end(), std::mt19937_64(3));
  for (const std::int64_t v : values) samples.add(v);
  EXPECT_EQ(samples.percentile_us(0.5), 500);
  EXPECT_EQ(samples.percentile_us(0.9), 900);
  EXPECT_EQ(samples.percentile_us(0.99), 990);
  EXPECT_EQ(samples.percentile_us(0.999), 999);
  EXPECT_EQ(samples.max_us(), 1000);
  EXPECT_EQ(samples.percentile_us(0), 1);
  samples.add(5'000'000);  // after it was sorted
  EXPECT_EQ(samples.max_us(), 5000);
  Samples one;
  one.add(7000);
  for (const double p : {0.0, 0.5, 0.999, 1.0}) EXPECT_EQ(one.percentile_us(p), 7);
}

TEST(BenchSamples, AClosedLoopSendsAgainAsSoonAsItIsAnswered) {
  Series series;
  int calls = 0;
  drive(
      [&] {
        ++calls;
        return Exchanged{calls % 3 != 0, 400, 300};
      },
      0, 0.3, series);
  EXPECT_GE(calls, 3);
  EXPECT_EQ(series.lost, static_cast<std::uint64_t>(calls / 3));
  EXPECT_EQ(series.latency.size() + series.lost, static_cast<std::uint64_t>(calls));
  EXPECT_EQ(series.server.percentile_us(0.5), 0.4);
  EXPECT_EQ(series.engine.percentile_us(0.5), 0.3);
  EXPECT_EQ(series.transport.size(), series.latency.size());
  EXPECT_LE(series.transport.percentile_us(0.5), series.latency.percentile_us(0.5));
  EXPECT_GE(series.seconds, 0.3);
  EXPECT_EQ(series.unsent, 0u);
}

// One reply takes 100 ms, while a request is due every millisecond: the latency of each of those includes its wait.
TEST(BenchSamples, AFixedRateChargesTheWaitBehindASlowReply) {
  Series series;
  int calls = 0;
  drive(
      [&] {
        if (calls++ == 0) std::this_thread::sleep_for(100ms);
        return Exchanged{};
      },
      1000, 1, series);
  ASSERT_EQ(series.latency.size() + series.unsent, 1000u);
  ASSERT_GE(series.latency.size(), 100u);
  // The request due at i ms cannot have been sent before 100 ms: its latency is at least (100 - i) ms.
  const double n = static_cast<double>(series.latency.size());
  EXPECT_GE(series.latency.max_us(), 100'000);
  EXPECT_GE(series.latency.percentile_us((n - 50) / n), 50'000);
  EXPECT_GE(series.latency.percentile_us((n - 90) / n), 10'000);
}

TEST(BenchSamples, RequestsThatWereDueButNotSentAreCounted) {
  Series series;
  drive(
      [] {
        std::this_thread::sleep_for(30ms);
        return Exchanged{};
      },
      1000, 0.05, series);
  EXPECT_GE(series.latency.size(), 1u);
  EXPECT_LE(series.latency.size(), 2u) << "30 ms each, of 50";
  EXPECT_EQ(series.latency.size() + series.unsent, 50u);
}

TEST(BenchSamples, WaitUntilNeverReturnsEarly) {
  for (const auto ahead : {-1000us, 0us, 10us, 100us, 400us, 3000us}) {
    const auto when = Clock::now() + ahead;
    wait_until(when);
    EXPECT_GE(Clock::now(), when);
  }
}

}  // namespace
}  // namespace clearance::cli
