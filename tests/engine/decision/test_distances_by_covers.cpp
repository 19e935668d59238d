// Least distances of states by covers: the same rows as without at narrow tolerances, and true intervals at wide ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "engine/decision/cover_plan.h"
#include "engine/decision/kernel/distance_view.h"
#include "engine/selection/configuration_poses.h"
#include "tests/engine/decision/least_distances.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {
namespace {

void narrow_tolerances_keep_every_bit(const CoverEngines& engines) {
  ArmStates s = least_distances(engines.with.scene(), 600);
  s.query.fields = (kAllFields & ~(kFieldVerdict | kFieldFreeScale | kFieldGradient)) | kFieldPairLower;
  for (const Tolerance& tolerance : {Tolerance{0, 1e-6}, Tolerance{1e-6, 1e-6}, Tolerance{0, 0}}) {
    const Answer without = bounds_of(engines.without, s.query, tolerance),
                 with = bounds_of(engines.with, s.query, tolerance);
    const auto counts = expect_same_rows(without, 0, with, 600);
    expect_same_column("pair_lower", without.view.pair_lower, 0, with.view.pair_lower, 600, 1);
    if (tolerance.rel > 0) {
      EXPECT_GT(counts[static_cast<std::size_t>(Status::kOk)], 50u);
    }
    EXPECT_GT(counts[static_cast<std::size_t>(Status::kOverlap)], 50u);
    EXPECT_LT(with.info.pairs_evaluated, 2 * without.info.pairs_evaluated / 3) << "covers leave most pairs out";
  }
}

void rows_of_near_pairs_keep_every_bit(const CoverEngines& engines) {
  const SameCovers engine(crowded_scene(false), engines);
  ArmStates s = least_distances(engine.with.scene(), 600);
  s.query.fields = (kAllFields & ~(kFieldVerdict | kFieldFreeScale | kFieldGradient)) | kFieldPairLower;
  const std::vector<BodyPair> pairs = pairs_with(engine.with.scene(), "table");
  std::uint64_t near = 0, beyond = 0;
  for (const double most : {0.02, 0.1, 0.4}) {
    s.query.max_distance = most;
    s.query.all_pairs = most < 0.4;
    if (!s.query.all_pairs) s.query.pairs = pairs;
    for (const Tolerance& tolerance : {Tolerance{0, 1e-6}, Tolerance{5e-5, 0}}) {
      const Answer without = bounds_of(engine.without, s.query, tolerance),
                   with = bounds_of(engine.with, s.query, tolerance);
      const auto counts = expect_same_rows(without, 0, with, 600);
      expect_same_column("pair_lower", without.view.pair_lower, 0, with.view.pair_lower, 600, 1);
      EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated) << most;
      near += counts[static_cast<std::size_t>(Status::kOk)];
      beyond += counts[static_cast<std::size_t>(Status::kBeyond)];
    }
  }
  EXPECT_GT(near, 100u);
  EXPECT_GT(beyond, 50u);
}

void wide_tolerances_contain_the_distance(const CoverEngines& engines) {
  ArmStates s = least_distances(engines.with.scene(), 600);
  const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});
  std::uint64_t before = ~std::uint64_t{0};
  for (const Tolerance& tolerance : {Tolerance{1e-4, 0}, {1e-3, 0}, {3e-3, 0}, {1e-2, 0}, {5e-2, 0}}) {
    const Answer rows = bounds_of(engines.with, s.query, tolerance);
    EXPECT_GT(expect_true_rows(exact, rows, tolerance, 600), 100) << tolerance.abs;
    EXPECT_LE(rows.info.pairs_evaluated, before) << "a wider tolerance needs no more work";
    before = rows.info.pairs_evaluated;
    if (tolerance.abs == 1e-4) {
      EXPECT_GT(before, 100u) << "the exact engine evaluates what covers leave";
    }
  }
  EXPECT_LT(before, 240u) << "covers answer most states";
  const Answer tenth = bounds_of(engines.with, s.query, {0, 0.1});
  EXPECT_GT(expect_true_rows(exact, tenth, {0, 0.1}, 600), 100);
}

void pairs_of_rows_have_their_bounds(const CoverEngines& engines) {
  ArmStates s = least_distances(engines.with.scene(), 100);
  const Tolerance tolerance{2e-2, 0};
  const Answer rows = bounds_of(engines.with, s.query, tolerance);
  for (std::uint32_t k = 0; k < 100; ++k) {
    QueryView one = s.query;
    one.all_pairs = false;
    one.pairs = std::span(&rows.view.pair[k], 1);
    one.positions = s.query.positions.subspan(k * s.joints.size(), s.joints.size());
    one.configuration_count = 1;
    const Answer pair = bounds_of(engines.without, one, {0, 1e-12});
    EXPECT_LE(pair.view.lower[0], rows.view.upper[k]) << k << ": the upper bound is that of the row's pair";
    one.pairs = std::span(&rows.view.pair_lower[k], 1);
    const Answer pair_lower = bounds_of(engines.without, one, {0, 1e-12});
    EXPECT_GE(pair_lower.view.upper[0], rows.view.lower[k]) << k;
  }
}

void points_are_those_of_the_distance(const CoverEngines& engines) {
  ArmStates s = least_distances(engines.with.scene(), 600);
  const Tolerance tolerance{1e-2, 0};
  const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});
  s.query.fields |= kFieldPoints;
  const Answer rows = bounds_of(engines.with, s.query, tolerance);
  EXPECT_GT(expect_true_rows(exact, rows, tolerance, 600), 100);
  for (std::uint64_t k = 0; k < 600; ++k) {
    if (!has(rows, k, Status::kOk)) continue;
    const double *a = rows.view.point_a + 3 * k, *b = rows.view.point_b + 3 * k;
    EXPECT_NEAR(std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]), rows.view.upper[k], 1e-9) << k;
  }
}

void states_beyond_max_distance_are_proved(const CoverEngines& engines, const std::string& body) {
  SCOPED_TRACE(body);
  ArmStates s = least_distances(engines.with.scene(), 600);
  const std::vector<BodyPair> pairs = pairs_with(engines.with.scene(), body);
  s.query.all_pairs = false;
  s.query.pairs = pairs;
  const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});
  s.query.max_distance = 0.05;
  const Answer rows = bounds_of(engines.with, s.query, {1e-2, 0});
  int beyond = 0, near = 0;
  for (std::uint64_t k = 0; k < 600; ++k) {
    EXPECT_LE(rows.view.lower[k], exact.view.upper[k]) << k;
    EXPECT_GE(rows.view.upper[k], exact.view.lower[k]) << k;
    if (has(rows, k, Status::kBeyond)) {
      ++beyond;
      EXPECT_GT(rows.view.lower[k], 0.05) << k;
      EXPECT_EQ(rows.view.distance[k], rows.view.lower[k]) << k;
      EXPECT_LT(rows.view.upper[k], 1e3) << k;
      EXPECT_TRUE(std::any_of(pairs.begin(), pairs.end(), [&](const BodyPair& pair) {
        return pair.a == rows.view.pair[k].a && pair.b == rows.view.pair[k].b;
      })) << k;
    } else if (has(rows, k, Status::kOk)) {
      ++near;
      EXPECT_LE(rows.view.upper[k] - rows.view.lower[k], 1e-2) << k;
    } else {
      EXPECT_TRUE(has(exact, k, Status::kOverlap)) << k;
    }
    if (exact.view.lower[k] > 0.06) {
      EXPECT_TRUE(has(rows, k, Status::kBeyond)) << k;
    }
  }
  EXPECT_GT(beyond, 10);
  EXPECT_GT(near, 2);
  EXPECT_LT(rows.info.pairs_evaluated, 60u) << "covers prove most states";
}

/// A state and its bounds, as numbers that must be the same.
using Bounds = std::tuple<double, double, std::uint64_t, std::uint64_t, bool, std::uint32_t, std::uint32_t>;

void every_kernel_gives_the_same_bounds(const CoverEngines& engines) {
  ArmStates s = least_distances(engines.with.scene(), 300);
  const engine::Engine& engine = engines.with;
  const PoseStore store(engine.scene(), std::chrono::seconds(1));
  Plan plan = make_plan(s.query, engine.scene(), store.snapshot(), 1u << 20, true);
  plan.uncertainties = uncertainties_of(engine.scene(), *plan.snapshot, 0);
  const auto covers = CoverPlan::make(engine.scene(), plan, *engine.cover_store());
  ASSERT_TRUE(covers);
  const DecisionView& view = covers->view();
  ConfigurationPoses poses(plan);
  const auto block = poses.at(0, 300);
  const std::vector<std::uint8_t> usable(300, 1);
  const std::vector<float> moved_inner(view.moved_pair_count + BallPacket::kBalls, BallPacket::kNoRadius);
  s.query.reduce = Reduce::kNone;
  s.query.fields = kDefaultFields | kFieldPair;
  const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});  // (states, pairs)
  const std::uint64_t pairs = plan.pairs.size();
  ASSERT_EQ(exact.size.rows, 300 * pairs);
  ASSERT_EQ(exact.view.pair[pairs - 1].b, plan.pairs.at(pairs - 1).b);
  for (const double width : {0.0, 0.002, 0.005, 0.02}) {
    std::vector<Bounds> first;
    std::vector<std::uint64_t> first_left;
    for (const DistanceKernel& kernel : distance_kernels()) {
      std::vector<DistanceBounds> found(300);
      std::vector<LeftPair> left(300 * 64);
      std::vector<float> lows(std::size_t{view.obstacle_count} * view.columns + moved_inner.size());
      std::vector<DistanceItem> items(3 * kMostDistanceItems);
      const DistanceLimits limits{.shift = {-width, -width}, .any_overlap = width > 0};
      kernel.run({&view, moved_inner.data(), limits, block.poses.data(), plan.bodies.size(), 300, usable.data(),
                  plan.positions.data(), plan.joints.size()},
                 {found.data(), left.data(), static_cast<std::uint32_t>(left.size()), lows.data(), items.data()});
      std::vector<Bounds> bounds;
      std::vector<std::uint64_t> positions;
      for (const DistanceBounds& b : found) {
        bounds.emplace_back(b.lower, b.upper, b.lower_at, b.upper_at, b.is_listed, b.left_begin, b.left_end);
        for (std::uint32_t i = b.left_begin; i < b.left_end; ++i) positions.push_back(left[i].position);
        ASSERT_TRUE(b.is_listed);
        const auto first_left_of = left.begin() + b.left_begin, last_left_of = left.begin() + b.left_end;
        const std::uint64_t row = (bounds.size() - 1) * pairs;
        for (std::uint64_t p = 0; p < pairs && b.upper > 0; ++p) {
          const bool is_left =
              std::any_of(first_left_of, last_left_of, [&](const LeftPair& pair) { return pair.position == p; });
          EXPECT_TRUE(is_left || exact.view.upper[row + p] >= b.lower) << kernel.name << ", pair " << p;
        }
        EXPECT_GE(std::max(b.upper, 0.0), exact.view.lower[row + b.upper_at]) << kernel.name;
      }
      EXPECT_GT(positions.size(), width == 0.02 ? 0u : 100u) << kernel.name << ": some pairs are left";
      if (first.empty()) first = bounds, first_left = positions;
      EXPECT_EQ(bounds, first) << kernel.name;
      EXPECT_EQ(positions, first_left) << kernel.name;
    }
  }
}

// Each state has a small obstacle near the surface of a link, or within it.
void small_obstacles_near_surfaces_are_seen(const CoverEngines& engines) {
  constexpr int kObstacles = 60;
  engine::Scene scene = crowded_scene();
  ArmStates s = least_distances(scene, kObstacles);
  s.query.fields |= kFieldPoints | kFieldNormal;
  const std::vector<BodyPair> pairs = pairs_with(scene, "ball");
  Random random(3);
  for (std::uint32_t k = 0; k < kObstacles; ++k) {
    QueryView one = s.query;
    one.all_pairs = false;
    one.pairs = std::span(&pairs[random.below(pairs.size())], 1);
    one.positions = s.query.positions.subspan(k * s.joints.size(), s.joints.size());
    one.configuration_count = 1;
    const Answer near = bounds_of(engines.without, one, {0, 1e-9});
    if (!has(near, 0, Status::kOk)) continue;
    const double gap = 1e-5 * std::pow(800, random.uniform(0, 1)), radius = random.uniform(1e-4, 2e-3);
    Vec3d at;
    for (int i = 0; i < 3; ++i) at[i] = near.view.point_b[i] - near.view.normal[i] * (k % 4 == 0 ? -gap : gap + radius);
    scene.add_sphere("grain" + std::to_string(k), radius, {.is_static = true, .pose = Pose{at}});
  }
  const SameCovers engine(scene, engines);
  std::vector<BodyPair> with_grains;
  for (std::uint32_t b = scene.find_body("held") + 1; b < scene.bodies().size(); ++b)
    for (const BodyPair& pair : pairs) with_grains.push_back({b, pair.b});
  s.query.all_pairs = false;
  s.query.pairs = with_grains;
  s.query.fields = kBoundFields;
  const Answer exact = bounds_of(engine.without, s.query, {0, 1e-12});
  int tiny = 0;
  for (std::uint64_t k = 0; k < kObstacles; ++k) tiny += exact.view.upper[k] > 0 && exact.view.upper[k] < 8e-3;
  EXPECT_GT(tiny, 15);
  for (const Tolerance& tolerance : {Tolerance{1e-3, 0}, {1e-2, 0}, {5e-2, 0}, {0, 0.1}})
    expect_true_rows(exact, bounds_of(engine.with, s.query, tolerance), tolerance, kObstacles);
  expect_same_rows(bounds_of(engine.without, s.query, {0, 1e-6}), 0, bounds_of(engine.with, s.query, {0, 1e-6}),
                   kObstacles);
}

void uncertainty_widens_intervals(const CoverEngines& engines) {
  engine::Scene scene = crowded_scene();
  scene.add_box("doubtful", {0.3, 0.3, 0.3},
                {.is_static = true, .pose = Pose{{0.3, 0.3, 0.2}}, .uncertainty = {.position = 0.003, .angle = 0.02}});
  const SameCovers engine(scene, engines);
  ArmStates s = least_distances(scene, 300);
  const std::vector<BodyPair> pairs = pairs_with(scene, "doubtful");
  s.query.all_pairs = false;
  s.query.pairs = pairs;
  expect_same_rows(bounds_of(engine.without, s.query, {0, 1e-6}), 0, bounds_of(engine.with, s.query, {0, 1e-6}), 300);
  const Answer exact = bounds_of(engine.without, s.query, {0, 1e-12});
  for (const double wide : {2e-3, 1e-2, 1e-1}) {
    const Answer without = bounds_of(engine.without, s.query, {wide, 0}),
                 with = bounds_of(engine.with, s.query, {wide, 0});
    EXPECT_GT(expect_true_rows(exact, with, {wide, 0}, 300), 100);
    int limited = 0;
    for (int k = 0; k < 300; ++k) {
      EXPECT_LE(with.view.lower[k], exact.view.lower[k]) << k << ": slack is in the bounds";
      EXPECT_GE(with.view.upper[k], exact.view.upper[k] * (1 - 1e-9)) << k;
      limited += (with.view.flags[k] & kFlagUncertaintyLimited) != 0;
    }
    EXPECT_EQ(limited > 100, wide < 5e-3) << limited << " rows are limited by uncertainty at " << wide;
    if (wide > 5e-2) {
      EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated / 2);
    }
  }
}

void bodies_without_a_pose_leave_the_distance_open(const CoverEngines& engines) {
  engine::Scene scene = crowded_scene();
  scene.add_box("lost", {0.1, 0.1, 0.1}, {.requires_pose = true});
  const SameCovers engine(scene, engines);
  ArmStates s = least_distances(scene, 100);
  expect_same_rows(bounds_of(engine.without, s.query, {0, 1e-6}), 0, bounds_of(engine.with, s.query, {0, 1e-6}), 100);
  const Answer without = bounds_of(engine.without, s.query, {0, 1e-6}),
               with = bounds_of(engine.with, s.query, {1e-2, 0});
  int lost = 0;
  for (int k = 0; k < 100; ++k) {
    EXPECT_EQ(with.view.status[k], without.view.status[k]) << k;
    EXPECT_TRUE(with.view.flags[k] & kFlagIncomplete) << k;
    lost += has(with, static_cast<std::uint64_t>(k), Status::kNoPose);
  }
  EXPECT_GT(lost, 10);
}

// In one process: the covers take seconds.
TEST(DistancesByCovers, IntervalsAreTrueAndKeepTheirBits) {
  ::setenv("CLEARANCE_CACHE", "off", 1);
  const CoverEngines engines;
  ASSERT_TRUE(engines.with.wait_covers(kCoversPatience));
  narrow_tolerances_keep_every_bit(engines);
  rows_of_near_pairs_keep_every_bit(engines);
  wide_tolerances_contain_the_distance(engines);
  pairs_of_rows_have_their_bounds(engines);
  points_are_those_of_the_distance(engines);
  for (const char* const body : {"table", "scan", "voxels"}) states_beyond_max_distance_are_proved(engines, body);
  every_kernel_gives_the_same_bounds(engines);
  small_obstacles_near_surfaces_are_seen(engines);
  uncertainty_widens_intervals(engines);
  bodies_without_a_pose_leave_the_distance_open(engines);
}

}  // namespace
}  // namespace clearance::test
