// Decisions by covers: the same rows as without, on every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "engine/decision/cover_plan.h"
#include "engine/selection/configuration_poses.h"
#include "tests/engine/crowded_arm.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kRows = kAllFields & ~kFieldGradient;

void rows_have_the_bits_that_they_have_without(const CoverEngines& engines) {
  ArmStates c(engines.with.scene(), 600);
  std::uint64_t free = 0, hit = 0;
  for (const double margin : {0.0, 0.02}) {
    c.query.margin = margin;
    const Answer without = evaluate(engines.without, c.query), with = evaluate(engines.with, c.query);
    const auto counts = expect_same_rows(without, 0, with, 600);
    free += counts[static_cast<std::size_t>(Status::kBeyond)];
    hit += counts[0] + counts[1] + counts[2];
    EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated / 2) << "covers decide most pairs";
  }
  EXPECT_GT(free, 100u);
  EXPECT_GT(hit, 100u);
}

void verdicts_and_pairs_are_those_of_the_rows(const CoverEngines& engines) {
  ArmStates c(engines.with.scene(), 600);
  c.query.fields = kFieldVerdict | kFieldPair;
  const Answer rows = evaluate(engines.without, c.query), pairs = evaluate(engines.with, c.query);
  c.query.fields = kFieldVerdict;
  const Answer bare = evaluate(engines.with, c.query);
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

void motions_have_the_verdicts_that_they_have_without(const CoverEngines& engines) {
  ArmStates c(engines.with.scene(), 600);
  const std::size_t joints = c.joints.size();
  for (std::size_t k = 1; k < 600; k += 2)  // a tenth of the way to the next state
    for (std::size_t j = 0; j < joints; ++j) {
      double& end = c.positions[k * joints + j];
      const double start = c.positions[(k - 1) * joints + j];
      end = start + 0.1 * (end - start);
    }
  c.query.fields = kFieldVerdict;
  c.query.max_evaluations = 256;
  for (const double margin : {0.0, 0.02}) {
    c.query.margin = margin;
    const Answer without = evaluate(engines.without, c.query), with = evaluate(engines.with, c.query);
    int free = 0, hit = 0;
    for (int k = 0; k < 300; ++k) {
      EXPECT_EQ(without.view.verdict[k], with.view.verdict[k]) << k << ", margin " << margin;
      free += with.view.verdict[k] == static_cast<std::uint8_t>(Status::kBeyond);
      hit += with.view.verdict[k] == static_cast<std::uint8_t>(Status::kOk);
    }
    EXPECT_GT(free, 10);
    EXPECT_GT(hit, 20);
    EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated / 2) << "covers decide most motions";
  }
}

void every_kernel_gives_the_same_decisions(const CoverEngines& engines) {
  ArmStates c(engines.with.scene(), 300);
  const engine::Engine& engine = engines.with;
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

void bodies_without_a_pose_are_reported_as_without(const CoverEngines& engines) {
  ArmStates c(engines.with.scene(), 50);
  engine::Engine::Options options{.backend = "cpu", .threads = 1, .cover_store = engines.with.cover_store()};
  engine::Scene scene = crowded_scene();
  scene.add_box("lost", {0.1, 0.1, 0.1}, {.requires_pose = true});
  const engine::Engine with(engine::Scene(scene), options);
  ASSERT_TRUE(with.wait_covers(kCoversPatience));
  options.covers = engine::Covers::kOff;
  options.cover_store = nullptr;
  const engine::Engine without(engine::Scene(scene), options);
  const auto counts = expect_same_rows(evaluate(without, c.query), 0, evaluate(with, c.query), 50);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kNoPose)], 0u);
  EXPECT_EQ(counts[static_cast<std::size_t>(Status::kBeyond)], 0u);
}

// In one process: the covers take seconds.
TEST(DecidedByCovers, AnswersAreThoseWithoutOnEveryInstructionSet) {
  ::setenv("CLEARANCE_CACHE", "off", 1);
  const CoverEngines engines;
  ASSERT_TRUE(engines.with.wait_covers(kCoversPatience));
  rows_have_the_bits_that_they_have_without(engines);
  verdicts_and_pairs_are_those_of_the_rows(engines);
  motions_have_the_verdicts_that_they_have_without(engines);
  every_kernel_gives_the_same_decisions(engines);
  bodies_without_a_pose_are_reported_as_without(engines);
}

}  // namespace
}  // namespace clearance::test
