// A seeded sample of the motions that make certify checks, of every kind.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <memory>

#include "tests/engine/motion/motion_oracle.h"

namespace clearance::test {
namespace {

class MotionOracleTest : public ::testing::TestWithParam<int> {};

TEST_P(MotionOracleTest, NothingIsNearerThanReportedNorFarther) {
  const MotionFindings found = check_many(11, 40, GetParam());
  std::printf("%s\n", found.text().c_str());
  EXPECT_EQ(found.wrong(), 0) << found.text();
  EXPECT_GE(found.motions, 40);
  EXPECT_GT(found.free, 3);
  EXPECT_GT(found.hits, 5);
  EXPECT_GT(found.decided, 20) << "with fewer steps";
  if (GetParam() != static_cast<int>(MotionKind::kStill)) {
    EXPECT_GT(found.stopped, 0);
  }
}

TEST(MotionOracle, TrajectoriesAreDecidedRightWithAnyNumberOfSteps) {
  const MotionFindings found = check_trajectories(5, 40);
  std::printf("%s\n", found.text().c_str());
  EXPECT_EQ(found.wrong(), 0) << found.text();
  EXPECT_GT(found.free, 10);
  EXPECT_GT(found.hits, 20);
  EXPECT_GT(found.stopped, 20);
  EXPECT_GT(found.turned, 10);
  EXPECT_GT(found.by_covers, 20);
}

// By an engine with covers for each scene: motions that it proves free alone, as it does for verdicts.
TEST(MotionOracleOfCovers, FreeMotionsOfJointsAndBodiesAreFree) {
  int by_covers = 0;
  const MakeMotionDecider make = [&](const engine::Scene& scene) -> MotionDecider {
    const auto engine =
        std::make_shared<engine::Engine>(engine::Scene(scene), engine::Engine::Options{.backend = "cpu", .threads = 1});
    engine->wait_covers(std::chrono::seconds(60));
    return [&by_covers, engine](QueryView query) -> MotionDecision {
      if (query.reduce != Reduce::kAny) return {};
      query.fields = kFieldVerdict;
      const Answer answer = evaluate(*engine, query);
      by_covers += answer.info.pairs_evaluated == 0;
      return {.kind = static_cast<Status>(answer.view.verdict[0]) == Status::kBeyond ? MotionDecision::kFree
                                                                                     : MotionDecision::kOpen};
    };
  };
  const MotionFindings found = check_decisions(5, 60, static_cast<int>(MotionKind::kMeanwhile), make);
  std::printf("%s; %d by covers alone\n", found.text().c_str(), by_covers);
  EXPECT_EQ(found.wrong(), 0) << found.text();
  EXPECT_GT(found.free, 20);
  EXPECT_GT(by_covers, 5);
}

INSTANTIATE_TEST_SUITE_P(Kinds, MotionOracleTest, ::testing::Range(0, kMotionKinds),
                         [](const auto& kind) { return name_of(static_cast<MotionKind>(kind.param)); });

}  // namespace
}  // namespace clearance::test
