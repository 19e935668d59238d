// Decisions by covers: the same rows as without, on every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "engine/decision/cover_plan.h"
#include "engine/selection/configuration_poses.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {
namespace {

constexpr std::chrono::minutes kPatience{10};
constexpr std::uint32_t kRows = kAllFields & ~kFieldGradient;

/// The arm among one obstacle of each kind. It holds a box, and a link of it is padded.
engine::Scene crowded_scene() {
  engine::RobotOptions arm = at_home();
  arm.link_padding = {{"fore", 0.01}};
  engine::Scene scene = arm_scene(arm);
  scene.add_half_space("floor", {.pose = Pose{{0, 0, -0.4}}});
  const auto still = [](Vec3d at, double angle) {
    return engine::Scene::BodyOptions{.is_static = true,
                                      .pose = Pose{at, std::cos(angle / 2), 0, std::sin(angle / 2), 0}};
  };
  scene.add_capsule("rod", 0.05, 0.6, still({-0.4, 0.3, 0.4}, 0.7));
  scene.add_cylinder("post", 0.08, 0.8, still({0.3, -0.5, 0.4}, 0));
  scene.add_cone("cone", 0.1, 0.3, still({-0.3, -0.4, 0.3}, 0.2));
  Random random(11);
  scene.add_hull("rock", random.cloud(30, {0.2, 0.1, 0.15}), still({0.1, 0.6, 0.6}, 1.1));
  scene.add_box("held", {0.05, 0.04, 0.2}, {.parent = "arm/palm", .pose = Pose{{0, 0, 0.1}}});
  return scene;
}

struct Case {
  engine::Scene scene = crowded_scene();
  engine::Engine without{engine::Scene(scene), {.backend = "cpu", .threads = 2, .covers = engine::Covers::kOff}};
  engine::Engine with{engine::Scene(scene), {.backend = "cpu", .threads = 2}};
  std::vector<std::uint32_t> joints = joints_of(scene, "arm");
  std::vector<double> positions;
  std::vector<MarginEntry> margins;
  QueryView query;

  explicit Case(int states) {
    Random random(5);
    for (int i = 0; i < states; ++i)
      for (const std::uint32_t j : joints) {
        const SceneJoint& joint = scene.joints()[j];
        positions.push_back(random.uniform(std::max(joint.lower, -3.0), std::min(joint.upper, 3.0)));
      }
    query.joints = joints;
    query.positions = positions;
    query.configuration_count = static_cast<std::uint32_t>(states);
    query.reduce = Reduce::kAny;
    query.fields = kRows;
  }
};

class DecidedByCovers : public testing::Test {
 protected:
  void SetUp() override { ::setenv("CLEARANCE_CACHE", "off", 1); }
};

TEST_F(DecidedByCovers, RowsHaveTheBitsThatTheyHaveWithout) {
  Case c(600);
  ASSERT_TRUE(c.with.wait_covers(kPatience));
  std::uint64_t free = 0, hit = 0;
  for (const double margin : {0.0, 0.02}) {
    c.query.margin = margin;
    const Answer without = evaluate(c.without, c.query), with = evaluate(c.with, c.query);
    const auto counts = expect_same_rows(without, 0, with, 600);
    free += counts[static_cast<std::size_t>(Status::kBeyond)];
    hit += counts[0] + counts[1] + counts[2];
    EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated / 2) << "covers decide most pairs";
  }
  EXPECT_GT(free, 100u);
  EXPECT_GT(hit, 100u);
}

TEST_F(DecidedByCovers, VerdictsAndPairsAreThoseOfTheRows) {
  Case c(600);
  ASSERT_TRUE(c.with.wait_covers(kPatience));
  c.query.fields = kFieldVerdict | kFieldPair;
  const Answer rows = evaluate(c.without, c.query), pairs = evaluate(c.with, c.query);
  c.query.fields = kFieldVerdict;
  const Answer bare = evaluate(c.with, c.query);
  int hits = 0;
  for (int k = 0; k < 600; ++k) {
    EXPECT_EQ(rows.view.verdict[k], pairs.view.verdict[k]) << k;
    EXPECT_EQ(rows.view.verdict[k], bare.view.verdict[k]) << k;
    EXPECT_EQ(rows.view.pair[k].a, pairs.view.pair[k].a) << k;
    EXPECT_EQ(rows.view.pair[k].b, pairs.view.pair[k].b) << k;
    hits += rows.view.verdict[k] == static_cast<std::uint8_t>(Status::kOk);
  }
  EXPECT_GT(hits, 50);
  EXPECT_LT(hits, 550);
  EXPECT_LT(bare.info.pairs_evaluated, 600u) << "covers decide most states alone";
}

TEST_F(DecidedByCovers, MotionsHaveTheVerdictsThatTheyHaveWithout) {
  Case c(600);
  ASSERT_TRUE(c.with.wait_covers(kPatience));
  const std::size_t joints = c.joints.size();
  for (std::size_t k = 1; k < 600; k += 2)  // 0.3 of the way to the next state
    for (std::size_t j = 0; j < joints; ++j) {
      double& end = c.positions[k * joints + j];
      const double start = c.positions[(k - 1) * joints + j];
      end = start + 0.3 * (end - start);
    }
  c.query.fields = kFieldVerdict;
  c.query.max_evaluations = 256;
  for (const double margin : {0.0, 0.02}) {
    c.query.margin = margin;
    const Answer without = evaluate(c.without, c.query), with = evaluate(c.with, c.query);
    int free = 0, hit = 0;
    for (int k = 0; k < 300; ++k) {
      EXPECT_EQ(without.view.verdict[k], with.view.verdict[k]) << k << ", margin " << margin;
      free += with.view.verdict[k] == static_cast<std::uint8_t>(Status::kBeyond);
      hit += with.view.verdict[k] == static_cast<std::uint8_t>(Status::kOk);
    }
    EXPECT_GT(free, 20);
    EXPECT_GT(hit, 20);
    EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated / 2) << "covers decide most motions";
  }
}

TEST_F(DecidedByCovers, EveryKernelGivesTheSameDecisions) {
  Case c(300);
  ASSERT_TRUE(c.with.wait_covers(kPatience));
  const engine::Engine& engine = c.with;
  const PoseStore store(engine.scene(), std::chrono::seconds(1));
  Plan plan = make_plan(c.query, engine.scene(), store.snapshot(), 1u << 20, true);
  plan.uncertainties = uncertainties_of(engine.scene(), *plan.snapshot, 0);
  const auto covers = CoverPlan::make(engine.scene(), plan, *engine.cover_store());
  ASSERT_TRUE(covers);
  ConfigurationPoses poses(plan);
  const auto block = poses.at(0, 300);
  const std::vector<std::uint8_t> usable(300, 1);
  for (const bool any_hit : {false, true}) {
    std::vector<std::uint64_t> first_open;
    std::vector<std::array<std::uint64_t, 4>> first;
    for (const DecisionKernel& kernel : decision_kernels()) {
      std::vector<Decision> decisions(300);
      std::vector<std::uint64_t> open(300 * 64);
      kernel.run({&covers->view(), block.poses.data(), plan.bodies.size(), 300, usable.data(), any_hit},
                 {decisions.data(), open.data(), static_cast<std::uint32_t>(open.size())});
      std::vector<std::array<std::uint64_t, 4>> found;
      std::array<int, 3> counts{};
      for (const Decision& d : decisions) {
        found.push_back({static_cast<std::uint64_t>(d.verdict), d.hit, d.open_begin, d.open_end});
        ++counts[static_cast<std::size_t>(d.verdict)];
      }
      open.resize(decisions.back().open_end);
      if (first.empty()) first = found, first_open = open;
      EXPECT_EQ(found, first) << kernel.name;
      EXPECT_EQ(open, first_open) << kernel.name;
      for (const int count : counts) EXPECT_GT(count, 0) << kernel.name << ": every verdict occurs";
    }
  }
}

TEST_F(DecidedByCovers, BodiesWithoutAPoseAreReportedAsWithout) {
  Case c(50);
  engine::Engine::Options options{.backend = "cpu", .threads = 1};
  engine::Scene scene = crowded_scene();
  scene.add_box("lost", {0.1, 0.1, 0.1}, {.requires_pose = true});
  const engine::Engine with(engine::Scene(scene), options);
  ASSERT_TRUE(with.wait_covers(kPatience));
  options.covers = engine::Covers::kOff;
  const engine::Engine without(engine::Scene(scene), options);
  const auto counts = expect_same_rows(evaluate(without, c.query), 0, evaluate(with, c.query), 50);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kNoPose)], 0u);
  EXPECT_EQ(counts[static_cast<std::size_t>(Status::kBeyond)], 0u);
}

}  // namespace
}  // namespace clearance::test
