// Columns other than bounds in rows that covers write: those of points and derivatives, and the flags of poses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "tests/engine/decision/least_distances.h"

namespace clearance::test {
namespace {

constexpr std::uint16_t kOfPoses = kFlagRenormalised | kFlagBeyondLimits;

/// An answer in memory that another one has used.
Answer over_used_memory(const engine::Engine& engine, QueryView query, const Tolerance& tolerance) {
  query.abs_tol = tolerance.abs;
  query.rel_tol = tolerance.rel;
  Answer a = empty_answer(engine, query);
  std::memset(a.memory.data(), 0x3b, a.memory.size());
  Job job = engine.start(query, a.view);
  while (!job.advance()) {
  }
  a.info = job.info();
  return a;
}

void expect_same_derivatives(const ReplyView& v, const ReplyView& w, std::uint64_t row, std::uint64_t joints) {
  expect_same_column("pair_lower", v.pair_lower, row, w.pair_lower + row, 1, 1);
  expect_same_column("gradient_joints", v.gradient_joints, row, w.gradient_joints + row * joints, 1, joints);
  expect_same_column("hessian_joints", v.hessian_joints, row, w.hessian_joints + row * joints * joints, 1,
                     joints * joints);
  expect_same_column("rate", v.rate, row, w.rate + row, 1, 1);
  expect_same_column("rate_bounds", v.rate_bounds, row, w.rate_bounds + 2 * row, 1, 2);
  expect_same_column("curvature", v.curvature, row, w.curvature + row, 1, 1);
  expect_same_column("smooth_radius", v.smooth_radius, row, w.smooth_radius + row, 1, 1);
  expect_same_column("point_a", v.point_a, row, w.point_a + 3 * row, 1, 3);
  expect_same_column("point_b", v.point_b, row, w.point_b + 3 * row, 1, 3);
  expect_same_column("normal", v.normal, row, w.normal + 3 * row, 1, 3);
  expect_same_column("pieces", v.parts, row, w.parts + 2 * row, 1, 2);
  expect_same_column("flags", v.flags, row, w.flags + row, 1, 1);
}

// Bodies without a pair, and an empty cloud.
void rows_without_points_have_each_column(const CoverEngines& engines) {
  engine::Scene scene = crowded_scene();
  const std::uint32_t nothing = scene.add_points("nothing", {}, 0, {.is_static = true, .pose = Pose{{0.2, 0.2, 0.2}}});
  const SameCovers engine(scene, engines);
  ArmStates s = least_distances(scene, 60);
  const std::vector<double> velocities(s.positions.size(), 0.5);
  s.query.reduce = Reduce::kNearest;
  s.query.velocities = velocities;
  s.query.fields = (kAllFields & ~kFieldGradient) | kFieldPairLower | kFieldGradientJoints | kSecondOrderFields;
  for (const Tolerance& tolerance : {Tolerance{0, 1e-6}, {1e-2, 0}}) {
    const Answer exact = over_used_memory(engine.without, s.query, tolerance),
                 rows = over_used_memory(engine.with, s.query, tolerance);
    EXPECT_LT(rows.info.pairs_evaluated, exact.info.pairs_evaluated) << "covers leave pairs out";
    const std::size_t bodies = scene.bodies().size();
    std::uint64_t without_points = 0, of_clouds = 0;
    for (std::uint64_t i = 0; i < exact.size.rows; ++i) {
      ASSERT_EQ(has(rows, i, Status::kBeyond), has(exact, i, Status::kBeyond)) << i;
      if (!has(exact, i, Status::kBeyond)) continue;
      expect_same_derivatives(exact.view, rows.view, i, s.joints.size());
      if (::testing::Test::HasFatalFailure()) return;
      ++without_points;
      of_clouds += i % bodies == nothing;
    }
    EXPECT_EQ(of_clouds, 60u);
    EXPECT_GT(without_points, of_clouds);
  }
}

/// Flags of poses by state and pair, of the exact engine.
class ExactFlags {
 public:
  ExactFlags(const engine::Engine& engine, QueryView query) {
    query.reduce = Reduce::kNone;
    query.max_distance = std::numeric_limits<double>::infinity();
    exact_ = evaluate(engine, query);
    for (std::uint64_t p = 0; p < exact_.size.pairs; ++p) pairs_.push_back(exact_.view.pair[p]);
  }
  std::uint16_t of(std::uint64_t state, BodyPair pair) const {
    const auto p = static_cast<std::uint64_t>(std::find(pairs_.begin(), pairs_.end(), pair) - pairs_.begin());
    return p < pairs_.size() ? exact_.view.flags[state * pairs_.size() + p] & kOfPoses : 0;
  }

 private:
  Answer exact_;
  std::vector<BodyPair> pairs_;
};

/// A scene with bodies whose quaternions are not units: one that stays, and one that the palm carries.
engine::Scene with_long_quaternions() {
  engine::Scene scene = crowded_scene();
  scene.add_box("loose", {0.1, 0.1, 0.1}, {.pose = Pose{{-0.3, 0.2, 0.6}, 1.01, 0, 0, 0}});
  scene.add_box("carried", {0.04, 0.04, 0.1}, {.parent = "arm/palm", .pose = Pose{{0, 0.1, 0.1}, 2, 0, 0, 0}});
  for (const char* link : {"arm/wrist", "arm/palm", "arm/flange", "arm/left_finger", "arm/right_finger", "held"})
    scene.ignore("carried", link);
  return scene;
}

void compare_flags(const engine::Engine& with, const engine::Engine& without, QueryView query) {
  query.fields = kBoundFields | kFieldConfiguration;
  const ExactFlags exact(without, query);
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest, Reduce::kMin, Reduce::kWithin}) {
    query.reduce = reduce;
    query.max_distance = reduce == Reduce::kWithin ? 0.3 : std::numeric_limits<double>::infinity();
    for (const Tolerance& tolerance : {Tolerance{2e-2, 0}, {0, 1e-6}}) {
      const Answer rows = bounds_of(with, query, tolerance);
      std::uint64_t plain = 0, renormalised = 0, beyond = 0;
      for (std::uint64_t i = 0; i < rows.info.rows; ++i) {
        const auto flags = static_cast<std::uint16_t>(rows.view.flags[i] & kOfPoses);
        ASSERT_EQ(flags, exact.of(rows.view.configuration[i], rows.view.pair[i])) << i << ", " << int(reduce);
        plain += flags == 0;
        renormalised += (flags & kFlagRenormalised) != 0;
        beyond += (flags & kFlagBeyondLimits) != 0;
      }
      EXPECT_GT(beyond, 5u);
      if (reduce != Reduce::kMin) {
        EXPECT_GT(plain, 50u);
        EXPECT_GT(renormalised, 50u);
      }
      if (reduce == Reduce::kNone && tolerance.abs > 0) {
        EXPECT_LT(rows.info.pairs_evaluated, rows.info.rows * 2 / 3) << "covers write rows";
      }
    }
  }
}

void flags_of_poses_are_those_of_the_exact_engine(const CoverEngines& engines) {
  const engine::Scene scene = with_long_quaternions();
  SameCovers engine(scene, engines);
  ArmStates s = least_distances(scene, 60);
  const std::size_t joints = s.joints.size();
  for (std::size_t k = 0; k < 60; k += 4)  // the elbow, beyond its limits
    s.positions[k * joints + 3] = scene.joints()[s.joints[3]].upper + 0.2;
  compare_flags(engine.with, engine.without, s.query);

  // A joint that the query leaves beyond its limits.
  const JointPosition over[] = {{s.joints[3], scene.joints()[s.joints[3]].upper + 0.2}};
  for (engine::Engine* each : {&engine.with, &engine.without}) each->set_joints(over);
  std::vector<double> others;
  std::vector<std::uint32_t> moved = s.joints;
  moved.erase(moved.begin() + 3);
  for (std::size_t i = 0; i < s.positions.size(); ++i)
    if (i % joints != 3) others.push_back(s.positions[i]);
  s.query.joints = moved;
  s.query.positions = others;
  compare_flags(engine.with, engine.without, s.query);
}

// Poses of the query itself, some of which are not units.
void flags_of_given_poses_are_those_of_the_exact_engine(const CoverEngines& engines) {
  engine::Scene scene = crowded_scene();
  scene.add_box("loose", {0.1, 0.1, 0.1}, {.pose = Pose{{-0.3, 0.2, 0.6}}});
  const SameCovers engine(scene, engines);
  const std::uint32_t bodies[] = {scene.find_body("loose")};
  Random random(66);
  std::vector<Pose> poses;
  for (int k = 0; k < 60; ++k) {
    Pose pose{{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(0, 1)}};
    if (k % 4 == 0) pose.qw = 1.5;
    poses.push_back(pose);
  }
  QueryView query;
  query.bodies = bodies;
  query.configurations = poses;
  query.configuration_count = 60;
  query.fields = kBoundFields | kFieldConfiguration;
  query.abs_tol = 2e-2;
  query.reduce = Reduce::kMin;
  const Answer exact = evaluate(engine.without, query), rows = evaluate(engine.with, query);
  EXPECT_LT(rows.info.pairs_evaluated, exact.info.pairs_evaluated) << "covers leave pairs out";
  for (std::uint64_t k = 0; k < 60; ++k) EXPECT_EQ((rows.view.flags[k] & kFlagRenormalised) != 0, k % 4 == 0) << k;
}

// In one process: the covers take seconds.
TEST(ColumnsByCovers, AreThoseOfTheExactEngine) {
  ::setenv("CLEARANCE_CACHE", "off", 1);
  const CoverEngines engines;
  ASSERT_TRUE(engines.with.wait_covers(kCoversPatience));
  rows_without_points_have_each_column(engines);
  flags_of_poses_are_those_of_the_exact_engine(engines);
  flags_of_given_poses_are_those_of_the_exact_engine(engines);
}

}  // namespace
}  // namespace clearance::test
