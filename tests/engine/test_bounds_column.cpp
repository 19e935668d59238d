// The column of float32 bounds: those of float64, rounded outward, in any query.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

TEST(BoundsColumn, HoldsTheIntervalInEightBytes) {
  const engine::Engine engine(mixed_scene(40, 3, 5), {"cpu"});
  const std::vector<std::uint32_t> bodies{0, 1, 2, 3};
  Random random(9);
  std::vector<Pose> poses;
  for (int i = 0; i < 20 * 4; ++i) poses.push_back(random.pose(3));
  poses[5].qw = std::nan("");
  std::set<Status> seen;
  std::uint64_t inexact = 0;
  for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kNearest, Reduce::kMin, Reduce::kAny})
    for (const Precision precision : {Precision::kF64, Precision::kF32})
      for (const double max_distance : {0.5, std::numeric_limits<double>::infinity()}) {
        QueryView q;
        q.reduce = reduce;
        q.precision = precision;
        q.max_distance = reduce == Reduce::kAny ? std::numeric_limits<double>::infinity() : max_distance;
        q.fields = kFieldLower | kFieldUpper | kFieldStatus | kFieldBounds;
        q.configuration_count = 20;
        q.bodies = bodies;
        q.configurations = poses;
        const Answer a = evaluate(engine, q);
        ASSERT_GT(a.info.rows, 0u);
        for (std::uint64_t row = 0; row < a.info.rows; ++row) {
          const double lower = a.view.lower[row], upper = a.view.upper[row];
          const float low = a.view.bounds[2 * row], high = a.view.bounds[2 * row + 1];
          EXPECT_TRUE(low <= lower && high >= upper) << row;
          EXPECT_TRUE(std::nextafter(low, INFINITY) > lower || low == lower) << "no wider than it must be, " << row;
          EXPECT_TRUE(std::nextafter(high, -INFINITY) < upper || high == upper) << "no wider than it must be, " << row;
          inexact += low != lower;
          seen.insert(static_cast<Status>(a.view.status[row]));
        }
      }
  EXPECT_GT(inexact, 1000u);
  for (const Status status : {Status::kOk, Status::kOverlap, Status::kBeyond, Status::kBadPose})
    EXPECT_TRUE(seen.contains(status)) << static_cast<int>(status);
}

}  // namespace
}  // namespace clearance::test
