// Distances of each pair and of each body by covers: the same rows as without at narrow tolerances, and true intervals
// at wide ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/query/distance/pair_groups.h"
#include "engine/selection/configuration_poses.h"
#include "tests/engine/decision/least_distances.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kEveryField =
    (kAllFields & ~(kFieldVerdict | kFieldFreeScale | kFieldGradient)) | kFieldPairLower;

ArmStates distances_of(const engine::Scene& scene, Reduce reduce, int count) {
  ArmStates s = least_distances(scene, count);
  s.query.reduce = reduce;
  return s;
}

void narrow_tolerances_keep_every_bit_of_bodies(const CoverEngines& engines) {
  ArmStates s = distances_of(engines.with.scene(), Reduce::kNearest, 200);
  s.query.fields = kEveryField;
  for (const Tolerance& tolerance : {Tolerance{0, 1e-6}, Tolerance{1e-5, 1e-6}, Tolerance{0, 0}}) {
    const Answer without = bounds_of(engines.without, s.query, tolerance),
                 with = bounds_of(engines.with, s.query, tolerance);
    ASSERT_EQ(with.size.rows, 200 * engines.with.scene().bodies().size());
    const auto counts = expect_same_rows(without, 0, with, with.size.rows);
    expect_same_column("pair_lower", without.view.pair_lower, 0, with.view.pair_lower, with.size.rows, 1);
    EXPECT_GT(counts[static_cast<std::size_t>(Status::kOverlap)], 100u);
    EXPECT_GT(counts[static_cast<std::size_t>(Status::kBeyond)], 100u) << "bodies without pairs";
    EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated) << "covers leave pairs out";
  }
}

// A cloud has points that are equally near. Which of them gives the bits must not depend on the pairs before.
void least_distances_of_clouds_are_those_of_their_pairs(const CoverEngines& engines) {
  constexpr std::uint64_t kCount = 15000;  // the order matters in a few of them
  const engine::Scene& scene = engines.without.scene();
  std::vector<BodyPair> pairs = pairs_with(scene, "voxels");
  const std::vector<BodyPair> others = pairs_with(scene, "scan");
  pairs.insert(pairs.end(), others.begin(), others.end());
  ArmStates s = least_distances(scene, kCount);
  s.query.all_pairs = false;
  s.query.pairs = pairs;
  const Answer least = bounds_of(engines.without, s.query, {0, 1e-6});
  expect_same_rows(least, 0, bounds_of(engines.with, s.query, {0, 1e-6}), kCount);
  s.query.reduce = Reduce::kNone;
  const Answer all = bounds_of(engines.without, s.query, {0, 1e-6});
  std::uint64_t apart = 0;
  for (std::uint64_t k = 0; k < kCount; ++k) {
    if (!has(least, k, Status::kOk)) continue;
    ++apart;
    const auto p = std::find(pairs.begin(), pairs.end(), least.view.pair[k]) - pairs.begin();
    const std::uint64_t row = k * pairs.size() + static_cast<std::uint64_t>(p);
    ASSERT_EQ(all.view.pair[row], least.view.pair[k]) << k;
    EXPECT_EQ(least.view.upper[k], all.view.upper[row]) << k;
    if (least.view.pair_lower[k] == least.view.pair[k]) {
      EXPECT_EQ(least.view.lower[k], all.view.lower[row]) << k;
    }
  }
  EXPECT_GT(apart, kCount / 4);
}

void wide_tolerances_contain_each_distance(const CoverEngines& engines) {
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest}) {
    const ArmStates s = distances_of(engines.with.scene(), reduce, 200);
    const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});
    const std::uint64_t all = bounds_of(engines.without, s.query, {0, 1e-6}).info.pairs_evaluated;
    std::uint64_t before = ~std::uint64_t{0};
    for (const Tolerance& tolerance : {Tolerance{5e-3, 0}, {1e-2, 0}, {3e-2, 0}, {0.1, 0}}) {
      const Answer rows = bounds_of(engines.with, s.query, tolerance);
      EXPECT_GT(expect_true_rows(exact, rows, tolerance, exact.size.rows), 1000) << tolerance.abs;
      EXPECT_LE(rows.info.pairs_evaluated, before) << "a wider tolerance needs no more work";
      before = rows.info.pairs_evaluated;
    }
    EXPECT_LT(before, all / 5) << "covers answer most rows";
    const Answer tenth = bounds_of(engines.with, s.query, {0, 0.1});
    EXPECT_GT(expect_true_rows(exact, tenth, {0, 0.1}, exact.size.rows), 1000);
    EXPECT_LT(tenth.info.pairs_evaluated, all / 2);
  }
}

void wide_tolerances_contain_each_distance_of_single_parts(const CoverEngines& engines) {
  const SameCovers engine(crowded_scene(false), engines);
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest}) {
    const ArmStates s = distances_of(engine.with.scene(), reduce, 200);
    const Answer exact = bounds_of(engine.without, s.query, {0, 1e-12});
    for (const Tolerance& tolerance : {Tolerance{5e-2, 0}, {0.2, 0}, {0, 0.3}}) {
      const Answer rows = bounds_of(engine.with, s.query, tolerance);
      EXPECT_GT(expect_true_rows(exact, rows, tolerance, exact.size.rows), 1000);
      EXPECT_LT(rows.info.pairs_evaluated, exact.info.pairs_evaluated / 2) << "covers answer most rows";
    }
  }
}

// A row of `within`, and that of the same pair among all.
void wide_tolerances_find_the_pairs_within_a_distance(const CoverEngines& engines) {
  ArmStates s = distances_of(engines.with.scene(), Reduce::kNone, 200);
  const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});
  const std::uint64_t pairs = exact.size.pairs;
  s.query.reduce = Reduce::kWithin;
  s.query.max_distance = 0.15;
  s.query.fields = kBoundFields | kFieldConfiguration;
  for (const Tolerance& tolerance : {Tolerance{1e-2, 0}, {5e-2, 0}, {0, 0.2}}) {
    const Answer rows = bounds_of(engines.with, s.query, tolerance);
    std::uint64_t at = 0, apart = 0;
    for (std::uint64_t i = 0; i < exact.size.rows; ++i) {
      const bool is_row =
          at < rows.info.rows && rows.view.configuration[at] == i / pairs && rows.view.pair[at] == exact.view.pair[i];
      EXPECT_TRUE(is_row || exact.view.upper[i] > 0.15) << i;
      if (!is_row) continue;
      EXPECT_LE(rows.view.lower[at], exact.view.upper[i]) << i;
      EXPECT_GE(rows.view.upper[at], exact.view.lower[i]) << i;
      if (has(exact, i, Status::kOverlap)) {
        EXPECT_TRUE(has(rows, at, Status::kOverlap)) << i;
      } else {
        const double width = rows.view.upper[at] - rows.view.lower[at];
        EXPECT_TRUE(has(rows, at, Status::kOk)) << i << ", status " << int(rows.view.status[at]);
        EXPECT_LE(width, std::max(tolerance.abs, tolerance.rel * rows.view.upper[at])) << i;
        ++apart;
      }
      ++at;
    }
    EXPECT_EQ(at, rows.info.rows) << "rows are in the order of the query";
    EXPECT_GT(apart, 500u);
    EXPECT_LT(rows.info.pairs_evaluated, at) << "covers answer rows";
  }
  const Answer all = bounds_of(engines.with, s.query, {1e-2, 0});
  s.query.max_results = 50;
  const Answer few = bounds_of(engines.with, s.query, {1e-2, 0});
  EXPECT_EQ(few.info.rows, 50u);
  EXPECT_EQ(few.info.total, all.info.total);
  expect_same_rows(all, 0, few, 50);
}

void beyond_pairs_are_proved(const CoverEngines& engines) {
  ArmStates s = distances_of(engines.with.scene(), Reduce::kNone, 100);
  const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});
  s.query.max_distance = 0.05;
  const Answer rows = bounds_of(engines.with, s.query, {1e-2, 0});
  int beyond = 0;
  for (std::uint64_t i = 0; i < exact.size.rows; ++i) {
    EXPECT_LE(rows.view.lower[i], exact.view.upper[i]) << i;
    EXPECT_GE(rows.view.upper[i], exact.view.lower[i]) << i;
    EXPECT_TRUE(rows.view.pair[i] == exact.view.pair[i]) << i;
    if (!has(rows, i, Status::kBeyond)) continue;
    ++beyond;
    EXPECT_GT(rows.view.lower[i], 0.05) << i;
  }
  EXPECT_GT(beyond, 1000);
}

/// A group's bounds, as numbers that must be the same.
using Bounds =
    std::tuple<double, double, std::uint64_t, std::uint64_t, bool, std::uint32_t, std::uint32_t, std::uint32_t>;

void every_kernel_gives_the_same_groups(const CoverEngines& engines) {
  const engine::Engine& engine = engines.with;
  const PoseStore store(engine.scene(), std::chrono::seconds(1));
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest}) {
    const ArmStates s = distances_of(engine.scene(), reduce, 100);
    Plan plan = make_plan(s.query, engine.scene(), store.snapshot(), 1u << 20, true);
    plan.uncertainties = uncertainties_of(engine.scene(), *plan.snapshot, 0);
    const auto covers = CoverPlan::make(engine.scene(), plan, *engine.cover_store());
    ASSERT_TRUE(covers);
    PairGroups groups(plan, engine.scene(), {20, 40});
    groups.take(*covers, {});
    ConfigurationPoses poses(plan);
    const auto block = poses.at(0, 100);
    const std::vector<std::uint8_t> usable(100, 1);
    const DecisionView& view = covers->view();
    const std::vector<float> moved_inner(view.moved_pair_count + BallPacket::kBalls, BallPacket::kNoRadius);
    std::vector<Bounds> first;
    for (const DistanceKernel& kernel : distance_kernels()) {
      std::vector<DistanceBounds> found(100 * groups.count());
      std::vector<LeftPair> left(200 * plan.pairs.size());
      std::vector<float> lows(std::size_t{view.obstacle_count} * view.columns + moved_inner.size()), highs(lows.size());
      std::vector<DistanceItem> items(3 * kMostDistanceItems);
      kernel.run({&view,
                  moved_inner.data(),
                  {.shift = {-0.01, -0.01}, .any_overlap = true},
                  block.poses.data(),
                  plan.bodies.size(),
                  100,
                  usable.data(),
                  plan.positions.data(),
                  plan.joints.size(),
                  &groups.view()},
                 {found.data(), left.data(), static_cast<std::uint32_t>(left.size()), lows.data(), items.data(),
                  highs.data()});
      std::vector<Bounds> bounds;
      for (const DistanceBounds& b : found)
        bounds.emplace_back(b.lower, b.upper, b.lower_at, b.upper_at, b.is_listed, b.left_begin, b.left_end, b.packets);
      if (first.empty()) first = bounds;
      EXPECT_EQ(bounds, first) << kernel.name;
      EXPECT_GT(found.back().left_end, 10u) << "some pairs are left";
    }
  }
}

void bodies_without_a_pose_have_no_distance(const CoverEngines& engines) {
  engine::Scene scene = crowded_scene();
  scene.add_box("lost", {0.1, 0.1, 0.1}, {.requires_pose = true});
  const SameCovers engine(scene, engines);
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest, Reduce::kWithin}) {
    ArmStates s = distances_of(scene, reduce, 50);
    s.query.fields |= kFieldConfiguration;
    s.query.max_distance = reduce == Reduce::kWithin ? 0.1 : std::numeric_limits<double>::infinity();
    const Answer exact = bounds_of(engine.without, s.query, {0, 1e-6}),
                 rows = bounds_of(engine.with, s.query, {1e-2, 0});
    std::uint64_t lost = 0;
    for (std::uint64_t i = 0; i < exact.info.rows; ++i) lost += has(exact, i, Status::kNoPose);
    for (std::uint64_t i = 0; i < rows.info.rows; ++i) {
      lost -= has(rows, i, Status::kNoPose);
      if (reduce != Reduce::kWithin) {
        EXPECT_EQ(rows.view.status[i], exact.view.status[i]) << i;
        EXPECT_EQ(rows.view.flags[i] & kFlagIncomplete, exact.view.flags[i] & kFlagIncomplete) << i;
      }
    }
    EXPECT_EQ(lost, 0u);
    if (reduce == Reduce::kNearest)
      expect_same_rows(exact, 0, bounds_of(engine.with, s.query, {0, 1e-6}), exact.size.rows);
  }
}

void uncertainty_widens_rows(const CoverEngines& engines) {
  engine::Scene scene = crowded_scene();
  scene.add_box("doubtful", {0.3, 0.3, 0.3},
                {.is_static = true, .pose = Pose{{0.3, 0.3, 0.2}}, .uncertainty = {.position = 0.003, .angle = 0.02}});
  const SameCovers engine(scene, engines);
  const std::vector<BodyPair> pairs = pairs_with(scene, "doubtful");
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest}) {
    ArmStates s = distances_of(scene, reduce, 100);
    s.query.all_pairs = false;
    s.query.pairs = pairs;
    const Answer exact = bounds_of(engine.without, s.query, {0, 1e-12});
    for (const double wide : {5e-3, 1e-1}) {
      const Answer rows = bounds_of(engine.with, s.query, {wide, 0});
      EXPECT_GT(expect_true_rows(exact, rows, {wide, 0}, exact.size.rows), 100);
      int limited = 0;
      for (std::uint64_t i = 0; i < exact.size.rows; ++i) {
        EXPECT_LE(rows.view.lower[i], exact.view.lower[i]) << i << ": slack is in the bounds";
        limited += (rows.view.flags[i] & kFlagUncertaintyLimited) != 0;
      }
      EXPECT_EQ(limited > 50, wide < 1e-2) << limited << " rows are limited by uncertainty at " << wide;
    }
  }
}

// In slices, from a job that answers again, and while covers are made: the rows are true, and complete.
void rows_do_not_depend_on_slices(const CoverEngines& engines) {
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest, Reduce::kWithin}) {
    ArmStates s = distances_of(engines.with.scene(), reduce, 20);
    s.query.fields |= kFieldConfiguration;
    s.query.abs_tol = 2e-2;
    if (reduce == Reduce::kWithin) s.query.max_distance = 0.2;
    const Answer whole = evaluate(engines.with, s.query);
    for (int again = 0; again < 3; ++again) {
      const Answer sliced = evaluate(engines.with, s.query, std::chrono::nanoseconds(1));
      ASSERT_EQ(sliced.info.rows, whole.info.rows);
      EXPECT_EQ(sliced.info.total, whole.info.total);
      EXPECT_GT(sliced.info.rows, 100u);
      expect_same_rows(whole, 0, sliced, whole.info.rows);
    }
  }
}

void rows_are_true_while_covers_are_made(const CoverEngines& engines) {
  const engine::Engine fresh(crowded_scene(), {.backend = "cpu", .threads = 2});
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest}) {
    const ArmStates s = distances_of(fresh.scene(), reduce, 50);
    const Answer exact = bounds_of(engines.without, s.query, {0, 1e-12});
    EXPECT_GT(expect_true_rows(exact, bounds_of(fresh, s.query, {5e-2, 0}), {5e-2, 0}, exact.size.rows), 100);
  }
}

// In one process: the covers take seconds.
TEST(RowsByCovers, IntervalsAreTrueAndKeepTheirBits) {
  ::setenv("CLEARANCE_CACHE", "off", 1);
  const CoverEngines engines;
  ASSERT_TRUE(engines.with.wait_covers(kCoversPatience));
  narrow_tolerances_keep_every_bit_of_bodies(engines);
  least_distances_of_clouds_are_those_of_their_pairs(engines);
  wide_tolerances_contain_each_distance(engines);
  wide_tolerances_contain_each_distance_of_single_parts(engines);
  wide_tolerances_find_the_pairs_within_a_distance(engines);
  beyond_pairs_are_proved(engines);
  every_kernel_gives_the_same_groups(engines);
  bodies_without_a_pose_have_no_distance(engines);
  uncertainty_widens_rows(engines);
  rows_do_not_depend_on_slices(engines);
  rows_are_true_while_covers_are_made(engines);
}

}  // namespace
}  // namespace clearance::test
