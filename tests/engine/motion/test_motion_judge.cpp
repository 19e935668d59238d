// A seeded sample of what make certify judges: every kind of motion.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/engine/motion/motion_judge.h"

namespace clearance::test {
namespace {

class MotionJudge : public ::testing::TestWithParam<int> {};

TEST_P(MotionJudge, NothingIsNearerThanIsSaidNorFarther) {
  const MotionFindings found = judge_many(11, 40, GetParam());
  std::printf("%s\n", found.text().c_str());
  EXPECT_EQ(found.wrong(), 0) << found.text();
  EXPECT_GE(found.motions, 40);
  EXPECT_GT(found.free, 3);
  EXPECT_GT(found.hits, 5);
}

INSTANTIATE_TEST_SUITE_P(Kinds, MotionJudge, ::testing::Range(0, kMotionKinds),
                         [](const auto& kind) { return name_of(static_cast<MotionKind>(kind.param)); });

}  // namespace
}  // namespace clearance::test
