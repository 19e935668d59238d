// The self-test: its known results are correct, and faulty kernels are detected and rejected by name.
#include <gtest/gtest.h>

#include <cstdio>
#include <stdexcept>

#include "engine/engine.h"
#include "engine/narrow/self_test.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {
namespace {

TEST(SelfTest, KnowsExactDistances) {
  int apart = 0, touching = 0, overlapping = 0;
  for (const KnownPair& pair : known_pairs())
    for (const auto& [X_wa, X_wb] : pair.poses) {
      const ConvexPartView a{pair.a->vertices, pair.a->radius}, b{pair.b->vertices, pair.b->radius};
      const Result exact_value = exact_distance(a, X_wa, b, X_wb, true);
      EXPECT_EQ(exact_value.distance.compare(pair.exact), 0)
          << pair.kind << ": " << pair.exact << ", exact " << exact_value.distance.lower();
      ++(pair.exact > 0 ? apart : pair.exact == 0 ? touching : overlapping);
    }
  EXPECT_GT(apart, 100);
  EXPECT_GE(touching, 16);
  EXPECT_GE(overlapping, 24);
}

TEST(SelfTest, EveryWayToAnswerPasses) {
  EXPECT_EQ(self_tests().size(), 2 + lane_kernels().size());
  double seconds = 0;
  for (const SelfTest& test : self_tests()) {
    std::printf("%s: %zu answers, %.2f ms\n", test.name.c_str(), test.answers, 1e3 * test.seconds);
    EXPECT_TRUE(test.passed()) << test.name << ": " << test.first_wrong;
    EXPECT_GT(test.answers, 150u) << test.name;
    seconds += test.seconds;
  }
  std::printf("%.2f ms in all\n", 1e3 * seconds);
}

// Kernels with a fault each, based on the baseline's.
template <class Spoil>
void run_spoilt(const LaneBatch& batch, Spoil spoil) {
  lane_kernel("baseline").run(batch);
  for (std::size_t i = 0; i < batch.count; ++i)
    if (batch.answers[i].converged) spoil(batch.answers[i], i);
}
void run_f32_as_it_is(const LaneBatch& batch) {
  lane_kernel("baseline").run_f32(batch);
}
void too_high(const LaneBatch& batch) {
  run_spoilt(batch, [](LaneAnswer& a, std::size_t) { a.lower *= 1 + 1e-5, a.upper *= 1 + 1e-5; });
}
void one_lane_too_low(const LaneBatch& batch) {
  run_spoilt(batch, [](LaneAnswer& a, std::size_t i) {
    if (i % 8 == 5) a.lower *= 1 - 1e-5, a.upper *= 1 - 1e-5;
  });
}
void contradictory(const LaneBatch& batch) {
  run_spoilt(batch, [](LaneAnswer& a, std::size_t i) {
    if (i % 8 == 5) std::swap(a.lower, a.upper);
  });
}
void too_wide(const LaneBatch& batch) {
  run_spoilt(batch, [](LaneAnswer& a, std::size_t) { a.lower = -1; });
}

TEST(SelfTest, WhatComputesWronglyIsRejectedByName) {
  const LaneKernel good = lane_kernel("baseline");
  std::vector<LaneKernel> kernels;
  for (const auto run : {too_high, one_lane_too_low, contradictory, too_wide}) {
    kernels.assign({{"avx512", good.lanes, run, run_f32_as_it_is}, {"avx2", good.lanes, run, run_f32_as_it_is}, good});
    std::vector<SelfTest> tests{self_test_alone(true), self_test_alone(false)};
    for (const LaneKernel& k : kernels) tests.push_back(self_test_lanes(k));
    EXPECT_FALSE(tests[2].passed());
    EXPECT_TRUE(tests[4].passed()) << tests[4].first_wrong;
    EXPECT_EQ(passed_lane_kernel("auto", kernels, tests).name, "baseline");
    try {
      passed_lane_kernel("avx2", kernels, tests);
      FAIL();
    } catch (const std::runtime_error& e) {
      EXPECT_EQ(std::string(e.what()).find("instruction set 'avx2' fails the self-test on this machine ("), 0u)
          << e.what();
      EXPECT_NE(std::string(e.what()).find("; those that pass: baseline"), std::string::npos) << e.what();
    }
    kernels.pop_back();
    EXPECT_THROW(passed_lane_kernel("auto", kernels, tests), std::runtime_error);
  }
}

TEST(SelfTest, WithoutAnArithmeticTheEngineDoesNotStart) {
  for (const char* base : {"reference", "scalar"}) {
    SelfTest failed{base};
    failed.count("vertex before face: the distance is 1");
    failed.count("another");
    const std::vector<SelfTest> tests{failed};
    try {
      passed_lane_kernel("auto", lane_kernels(), tests);
      FAIL();
    } catch (const std::runtime_error& e) {
      EXPECT_EQ(std::string(e.what()), "the engine does not start: its " + std::string(base) +
                                           " arithmetic fails the self-test on this machine (vertex before face: the "
                                           "distance is 1)");
    }
  }
}

}  // namespace
}  // namespace clearance::exact
