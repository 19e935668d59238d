// Robots that brake at the last moment that check_stop() proves.
#include <gtest/gtest.h>

#include "tests/oracle/stops/approaches.h"

namespace clearance::stops {
namespace {

TEST(Stops, NobodyTouchesARobotThatBrakesAtTheLastProvedMoment) {
  Findings all;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) all.add(approach(seed, 150));
  EXPECT_EQ(all.wrong(), 0) << all.text();
  EXPECT_EQ(all.approaches, 600) << all.text();
  EXPECT_GT(all.close, 25) << "so late that a later moment would often be too late: " << all.text();
  EXPECT_GT(all.harder, 120) << all.text();
  EXPECT_GT(all.apart, 60) << all.text();
  EXPECT_GT(all.compared, 30) << all.text();
  EXPECT_GT(all.speed, 1.02 * all.capsule_speed) << all.text();
}

}  // namespace
}  // namespace clearance::stops
