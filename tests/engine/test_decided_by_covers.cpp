// Decisions by covers: the same rows as without, on every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "engine/decision/cover_plan.h"
#include "engine/decision/motion_decider.h"
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

/// Straight motions between states, a tenth of the way to the next one.
struct Edges : ArmStates {
  /// \param share of the way from a state to another
  explicit Edges(const engine::Scene& scene, double share = 0.1) : ArmStates(scene, 600) {
    const std::size_t each = joints.size();
    for (std::size_t k = 1; k < 600; k += 2)
      for (std::size_t j = 0; j < each; ++j) {
        double& end = positions[k * each + j];
        const double start = positions[(k - 1) * each + j];
        end = start + share * (end - start);
      }
    query.max_evaluations = 256;
  }
};

/// Motions along curves of degree 5, whose control points are near the first.
struct Curves : ArmStates {
  static constexpr std::size_t kPoints = 6;

  explicit Curves(const engine::Scene& scene) : ArmStates(scene, 1800) {
    const std::size_t each = joints.size();
    for (std::size_t k = 0; k < 1800; ++k)
      for (std::size_t j = 0; j < each; ++j) {
        double& q = positions[k * each + j];
        const double start = positions[k / kPoints * kPoints * each + j];
        q = start + 0.06 * (q - start);
      }
    query.max_evaluations = 256;
    query.control_points = kPoints;
  }
};

/// \param count of motions
void motions_have_the_verdicts_that_they_have_without(const CoverEngines& engines, ArmStates&& c, int count) {
  c.query.fields = kFieldVerdict;
  for (const double margin : {0.0, 0.005, 0.02}) {
    c.query.margin = margin;
    const Answer without = evaluate(engines.without, c.query), with = evaluate(engines.with, c.query);
    int free = 0, hit = 0;
    for (int k = 0; k < count; ++k) {
      EXPECT_EQ(without.view.verdict[k], with.view.verdict[k]) << k << ", margin " << margin;
      free += with.view.verdict[k] == static_cast<std::uint8_t>(Status::kBeyond);
      hit += with.view.verdict[k] == static_cast<std::uint8_t>(Status::kOk);
    }
    EXPECT_GT(free, 5);
    EXPECT_GT(hit, 20);
    EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated / 2) << "covers decide most motions";
  }
}

/// Covers decide free motions if the columns are the same for all of them.
void motions_have_the_rows_that_they_have_without(const CoverEngines& engines) {
  Edges c(engines.with.scene());
  constexpr std::uint32_t kOfFree = kFieldVerdict | kFieldConfiguration | kFieldUpper | kFieldStatus | kFieldFlags |
                                    kFieldPair | kFieldPairLower | kFieldTime | kFieldFirstContact;
  for (const std::uint32_t fields : {kOfFree, kOfFree & ~kFieldFirstContact, kOfFree | kFieldLower | kFieldSteps}) {
    c.query.fields = fields;
    const Answer without = evaluate(engines.without, c.query), with = evaluate(engines.with, c.query);
    const auto counts = expect_same_rows(without, 0, with, 300);
    EXPECT_GT(counts[static_cast<std::size_t>(Status::kBeyond)], 10u);
    EXPECT_GT(counts[static_cast<std::size_t>(Status::kOverlap)], 20u);
    for (int k = 0; k < 300; ++k) {
      EXPECT_EQ(std::bit_cast<std::uint64_t>(with.view.time[k]), std::bit_cast<std::uint64_t>(without.view.time[k]));
      EXPECT_EQ(with.view.pair_lower[k].a, without.view.pair_lower[k].a) << k;
      if (!(fields & kFieldFirstContact)) continue;
      EXPECT_EQ(with.view.first_contact[2 * k], without.view.first_contact[2 * k]) << k;
      EXPECT_EQ(with.view.first_contact[2 * k + 1], without.view.first_contact[2 * k + 1]) << k;
    }
    if (fields & kFieldSteps)
      EXPECT_EQ(with.info.pairs_evaluated, without.info.pairs_evaluated);
    else
      EXPECT_LT(with.info.pairs_evaluated, without.info.pairs_evaluated) << "covers decide some motions";
  }
}

/// Of each motion without a hit, every pair is left that is within its margin at a sample, with that time.
void motions_leave_the_pairs_that_are_near(const CoverEngines& engines) {
  constexpr double kMargin = 0.02;
  constexpr std::size_t kMotions = 300, kTimes = 17;
  Edges c(engines.with.scene(), 0.25);
  const std::size_t each = c.joints.size();
  std::vector<double> samples;
  for (std::size_t m = 0; m < kMotions; ++m)
    for (std::size_t t = 0; t < kTimes; ++t)
      for (std::size_t j = 0; j < each; ++j)
        samples.push_back(std::lerp(c.positions[2 * m * each + j], c.positions[(2 * m + 1) * each + j], t / 16.0));
  QueryView at_samples;
  at_samples.joints = c.joints;
  at_samples.positions = samples;
  at_samples.configuration_count = kMotions * kTimes;
  at_samples.fields = kFieldUpper;
  const Answer exact = evaluate(engines.without, at_samples);

  c.query.fields = kFieldVerdict;
  c.query.margin = kMargin;
  const engine::Engine& engine = engines.with;
  const PoseStore store(engine.scene(), std::chrono::seconds(1));
  Plan plan = make_plan(c.query, engine.scene(), store.snapshot(), 1u << 20, true);
  plan.uncertainties = uncertainties_of(engine.scene(), *plan.snapshot, 0);
  const auto covers = CoverPlan::make(engine.scene(), plan, *engine.cover_store());
  ASSERT_TRUE(covers && covers->rates());
  MotionDecider decider(*covers, plan);
  const std::size_t pairs = plan.pairs.size();
  ASSERT_EQ(exact.size.rows, kMotions * kTimes * pairs);
  int near = 0, parts = 0;
  for (std::size_t m = 0; m < kMotions; ++m) {
    const Verdict verdict = decider.decide(m);
    if (verdict == Verdict::kHit) continue;
    const auto open = decider.open();
    parts += std::any_of(open.begin(), open.end(), [](const OpenPair& o) { return o.end - o.begin < 1; });
    EXPECT_EQ(verdict == Verdict::kUnresolved, !open.empty()) << m;
    for (std::size_t t = 0; t < kTimes; ++t)
      for (std::size_t p = 0; p < pairs; ++p) {
        if (exact.view.upper[(m * kTimes + t) * pairs + p] > kMargin) continue;
        ++near;
        EXPECT_TRUE(
            std::any_of(open.begin(), open.end(),
                        [&](const OpenPair& o) { return o.position == p && o.begin <= t / 16.0 && t / 16.0 <= o.end; }))
            << "motion " << m << ", pair " << p << ", time " << t;
      }
  }
  EXPECT_GT(near, 10) << "some pairs are near without a hit that covers find";
  EXPECT_GT(parts, 0) << "pairs are left for a part of the time";
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

/// Each query has the newest points, and covers decide it at once.
void new_points_of_a_cloud_are_seen(const CoverEngines& engines) {
  engine::Engine with(crowded_scene(), {.backend = "cpu", .threads = 1, .cover_store = engines.with.cover_store()}),
      without(crowded_scene(), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  ASSERT_TRUE(with.wait_covers(kCoversPatience));
  ArmStates c(with.scene(), 300);
  c.query.fields = kFieldVerdict;
  std::vector<BodyPair> pairs;
  for (const std::uint32_t cloud : {with.scene().find_body("scan"), with.scene().find_body("voxels")})
    for (std::uint32_t b = 0; b < with.scene().bodies().size(); ++b)
      if (with.scene().bodies()[b].robot != kNone && !with.scene().bodies()[b].parts.empty())
        pairs.push_back({cloud, b});
  c.query.all_pairs = false;
  c.query.pairs = pairs;
  Random random(12);
  std::vector<std::uint8_t> last(300);
  int changed = 0, free = 0;
  for (int round = 0; round < 12; ++round) {
    const char* const name = round % 2 ? "voxels" : "scan";
    const Vec3d at{random.uniform(-0.6, 0.6), random.uniform(-0.6, 0.6), random.uniform(0.2, 0.9)};
    const std::vector<CloudPoint> points = scanned_box(at, {0.1, 0.1, 0.1}, round == 5 ? 0 : 800, random);
    for (engine::Engine* engine : {&with, &without}) engine->set_points(engine->scene().find_body(name), points);
    const Answer expected = evaluate(without, c.query), found = evaluate(with, c.query);
    for (int k = 0; k < 300; ++k) {
      EXPECT_EQ(found.view.verdict[k], expected.view.verdict[k]) << k << ", round " << round;
      changed += round > 0 && found.view.verdict[k] != last[static_cast<std::size_t>(k)];
      free += found.view.verdict[k] == static_cast<std::uint8_t>(Status::kBeyond);
    }
    std::copy_n(found.view.verdict, 300, last.begin());
    EXPECT_LT(found.info.pairs_evaluated, expected.info.pairs_evaluated / 2) << round;
  }
  for (const char* const name : {"scan", "voxels"})
    for (engine::Engine* engine : {&with, &without}) engine->set_points(engine->scene().find_body(name), {});
  c.query.fields = kAllFields & ~kFieldGradient;
  expect_same_rows(evaluate(without, c.query), 0, evaluate(with, c.query), 300);
  c.query.all_pairs = true;
  expect_same_rows(evaluate(without, c.query), 0, evaluate(with, c.query), 300);
  c.query.reduce = Reduce::kMin;
  c.query.fields = kDefaultFields;
  c.query.abs_tol = 1e-2;
  const Answer expected = evaluate(without, c.query), found = evaluate(with, c.query);
  for (int k = 0; k < 300; ++k) {
    EXPECT_LE(found.view.lower[k], expected.view.upper[k]) << k;
    EXPECT_GE(found.view.upper[k], expected.view.lower[k]) << k;
  }
  EXPECT_GT(changed, 300);
  EXPECT_GT(free, 1000);
}

// In one process: the covers take seconds.
TEST(DecidedByCovers, AnswersAreThoseWithoutOnEveryInstructionSet) {
  ::setenv("CLEARANCE_CACHE", "off", 1);
  const CoverEngines engines;
  ASSERT_TRUE(engines.with.wait_covers(kCoversPatience));
  rows_have_the_bits_that_they_have_without(engines);
  verdicts_and_pairs_are_those_of_the_rows(engines);
  motions_have_the_verdicts_that_they_have_without(engines, Edges(engines.with.scene()), 300);
  motions_have_the_verdicts_that_they_have_without(engines, Curves(engines.with.scene()), 300);
  motions_have_the_rows_that_they_have_without(engines);
  motions_leave_the_pairs_that_are_near(engines);
  every_kernel_gives_the_same_decisions(engines);
  bodies_without_a_pose_are_reported_as_without(engines);
  new_points_of_a_cloud_are_seen(engines);
}

}  // namespace
}  // namespace clearance::test
