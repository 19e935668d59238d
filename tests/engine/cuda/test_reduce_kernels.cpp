// The kernels of reductions (engine/cuda/reduce/reduce_kernel.cuh, any_kernel.cuh), compiled for the host, stage by
// stage: their rows must have the CPU's bits. No GPU needed.
#include "tests/engine/cuda/uncertain_scene.h"
// After all other headers.
#include "tests/engine/cuda/emulated_reduction.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

TEST(ReduceKernels, GiveTheBitsOfTheCpu) {
  std::uint64_t enclosed = 0;
  for (const double room : {1.0, 2.5, 8.0}) {
    EmulatedCase c(20, 13, room, 3,
                   [](engine::Scene& to, const std::string& name, const engine::Scene::BodyOptions& options) {
                     to.add_capsule(name, 0.2, 0.5, options);
                   });
    c.poses[4].translation.x = std::numeric_limits<double>::quiet_NaN();
    const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    c.q.fields = kAllFields | kFieldPairLower;
    for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin, Reduce::kWithin})
      for (const double distance : {kInf, 0.3}) {
        c.q.reduce = reduce;
        c.q.max_distance = distance;
        for (const bool proves_at_once : {false, true}) {
          HostReduction reduction(cpu, c.q);
          reduction.proves_at_once = proves_at_once;
          reduction.compare("reduce " + std::to_string(static_cast<int>(reduce)) + " room " + std::to_string(room) +
                            " within " + std::to_string(distance));
          enclosed += reduction.counted(kEnclosedPairs);
        }
      }
  }
  EXPECT_GT(enclosed, 50u) << "listed overlaps";
}

TEST(ReduceKernels, GiveTheBitsOfTheCpuForUncertainBodies) {
  std::uint64_t slack = 0, others = 0, left = 0;
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    UncertainCase c(30, 9);
    c.poses[8].qw = c.poses[8].qx = c.poses[8].qy = c.poses[8].qz = 0;
    const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    c.q.precision = precision;
    for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin, Reduce::kWithin})
      for (const double distance : {kInf, 0.02, 0.3}) {
        c.q.reduce = reduce;
        c.q.max_distance = distance;
        HostReduction reduction(cpu, c.q);
        reduction.proves_at_once = distance == 0.02;
        left += reduction.compare("reduce " + std::to_string(static_cast<int>(reduce)) + " within " +
                                  std::to_string(distance));
        for (std::uint64_t i = 0; i < reduction.row_count(); ++i) {
          slack += (reduction.rows().flags[i] & kFlagUncertaintyLimited) != 0;
          others += reduction.rows().pair[i] != reduction.rows().pair_lower[i];
        }
      }
  }
  EXPECT_GT(slack, 500u);
  EXPECT_GT(others, 10u) << "the least lower bound is another pair's";
  EXPECT_GT(left, 20u) << "the CPU finishes some";
}

// Counts of the results in rows of Reduce::kAny.
struct MarginCounts {
  std::uint64_t near = 0, overlap = 0, touching = 0, open = 0, beyond = 0, unusable = 0, incomplete = 0, left = 0;
  std::uint64_t enclosed = 0, later = 0;  // pairs listed by evaluate_near_hulls()

  void add(const HostReduction& reduction) {
    enclosed += reduction.counted(kEnclosedPairs);
    later += reduction.counted(kLaterItems);
    for (std::uint64_t i = 0; i < reduction.row_count(); ++i) {
      const auto status = static_cast<Status>(reduction.rows().status[i]);
      near += status == Status::kOk;
      overlap += status == Status::kOverlap;
      touching += status == Status::kContact;
      open += status == Status::kUnconverged;
      beyond += status == Status::kBeyond;
      unusable += status == Status::kBadPose;
      incomplete += reduction.rows().flags && (reduction.rows().flags[i] & kFlagIncomplete) != 0;
    }
  }
};

// Compares with one margin for all pairs, and with a margin per pair.
void compare_margins(const engine::Engine& cpu, QueryView q, const std::string& what, MarginCounts& outcomes) {
  const auto compare = [&](const std::string& with) {
    HostReduction reduction(cpu, q);
    outcomes.left += reduction.compare(what + with);
    outcomes.add(reduction);
  };
  q.reduce = Reduce::kAny;
  q.fields |= kFieldVerdict;
  for (const double margin : {0.0, 1e-6, 0.02, 0.3}) {
    q.margin = margin;
    compare(", margin " + std::to_string(margin));
  }
  Random random(4);
  std::vector<double> margins(q.pairs.size());
  for (const double most : {0.03, 0.5}) {
    for (double& margin : margins) margin = random.uniform(0, most);
    q.pair_margins = margins;
    compare(", margins up to " + std::to_string(most));
  }
}

TEST(ReduceKernels, DecideAsTheCpuDoes) {
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    MarginCounts outcomes, bounds;
    for (const double room : {1.0, 4.0, 12.0}) {
      EmulatedCase c(20, 29, room, 3,
                     [](engine::Scene& to, const std::string& name, const engine::Scene::BodyOptions& options) {
                       to.add_capsule(name, 0.2, 0.5, options);
                     });
      c.q.fields = kAllFields | kFieldPairLower;
      c.q.precision = precision;
      c.poses[4].translation.x = std::numeric_limits<double>::quiet_NaN();
      for (std::size_t i = 0; i < c.bodies.size(); ++i) c.poses[5 * c.bodies.size() + i].qw = kInf;
      const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
      compare_margins(cpu, c.q, "room " + std::to_string(room), outcomes);
      c.q.fields = kFieldStatus | kFieldLower | kFieldUpper | kFieldPair;  // without points
      compare_margins(cpu, c.q, "bounds, room " + std::to_string(room), bounds);
    }
    EXPECT_GT(bounds.later, 100u) << "pairs after one that probably overlaps";
    EXPECT_GT(bounds.near, 20u);
    EXPECT_GT(outcomes.near, 20u);
    EXPECT_GT(outcomes.overlap, 100u);
    EXPECT_GT(outcomes.beyond, 50u);
    EXPECT_GT(outcomes.unusable, 5u);
    EXPECT_GT(outcomes.incomplete, outcomes.unusable) << "some are decided all the same";
    EXPECT_GT(outcomes.left, 20u) << "capsules that overlap by less than their radii";
    EXPECT_GT(outcomes.enclosed, 100u);
  }
}

TEST(ReduceKernels, DecideAsTheCpuDoesUncertainBodies) {
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    UncertainCase c(30, 9);
    c.q.precision = precision;
    c.poses[8].qw = c.poses[8].qx = c.poses[8].qy = c.poses[8].qz = 0;
    c.positions[c.joints.size() * 3] = std::numeric_limits<double>::quiet_NaN();
    // Few of the pairs at a time, since otherwise every configuration has an overlap.
    const std::vector<BodyPair> all = c.pairs;
    const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    MarginCounts outcomes;
    for (std::size_t first = 0; first < 12; ++first) {
      std::vector<BodyPair> some;
      for (std::size_t i = first; i < all.size(); i += 12) some.push_back(all[i]);
      c.q.pairs = some;
      compare_margins(cpu, c.q, "pairs from " + std::to_string(first), outcomes);
    }
    EXPECT_GT(outcomes.near, 100u);
    EXPECT_GT(outcomes.overlap, 100u);
    EXPECT_GT(outcomes.touching, 20u);
    EXPECT_GT(outcomes.open, 5u) << "slack keeps them from being known";
    EXPECT_GT(outcomes.beyond, 20u);
    EXPECT_GT(outcomes.incomplete, 5u);
  }
}

// Device queries have no CPU to finish them.
TEST(ReduceKernels, AnswerWhatIsLeftAsWellAsTheyCan) {
  std::uint64_t left = 0, others = 0, rows = 0, unproved = 0;
  const auto run = [&](const engine::Engine& cpu, const QueryView& q, const std::string& what) {
    HostReduction reduction(cpu, q);
    left += reduction.compare_alone(what);
    others += reduction.others();
    rows += reduction.row_count();
    for (std::uint64_t i = 0; i < reduction.row_count(); ++i)
      unproved += static_cast<Status>(reduction.rows().status[i]) == Status::kUnconverged;
  };
  for (const Reduce reduce : {Reduce::kMin, Reduce::kAny}) {
    const std::string what = "reduce " + std::to_string(static_cast<int>(reduce));
    for (const double room : {1.0, 4.0, 12.0}) {
      EmulatedCase c(20, 29, room, 3,
                     [](engine::Scene& to, const std::string& name, const engine::Scene::BodyOptions& options) {
                       to.add_capsule(name, 0.2, 0.5, options);
                     });
      // Configuration 2: every body exactly on another, where nothing can be resolved.
      for (std::size_t i = 0; i < c.bodies.size(); ++i) c.poses[2 * c.bodies.size() + i] = Pose{{1.0 * (i % 4), 0, 0}};
      c.q.reduce = reduce;
      const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
      run(cpu, c.q, what + ", room " + std::to_string(room));
    }
    UncertainCase c(30, 9);
    c.positions[c.joints.size() * 3] = std::numeric_limits<double>::quiet_NaN();
    const std::vector<BodyPair> all = c.pairs;
    const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    c.q.reduce = reduce;
    for (std::size_t first = 0; first < 12; ++first) {
      std::vector<BodyPair> some;
      for (std::size_t i = first; i < all.size(); i += 12) some.push_back(all[i]);
      c.q.pairs = some;
      run(cpu, c.q, what + ", doubted, from " + std::to_string(first));
    }
  }
  EXPECT_GT(left, 100u);
  EXPECT_GT(others, 0u);
  EXPECT_LT(others, rows / 4) << "most are the CPU's all the same";
  EXPECT_GT(unproved, 5u);
}

// Slack raises the upper bound of the pair with the nearest boxes above that of its convex parts, so another pair wins.
TEST(ReduceKernels, LeaveOutNothingThatSlackMayLetWin) {
  engine::Scene scene;
  Body rough;
  rough.name = "rough";
  rough.is_static = true;
  rough.pose = Pose();
  rough.parts = {make_convex_part({{0.5, 0.5, 0.5},
                                   {-0.5, 0.5, 0.5},
                                   {0.5, -0.5, 0.5},
                                   {-0.5, -0.5, 0.5},
                                   {0.5, 0.5, -0.5},
                                   {-0.5, 0.5, -0.5},
                                   {0.5, -0.5, -0.5},
                                   {-0.5, -0.5, -0.5}})};
  rough.model_error = 0.01;
  scene.add_body(std::move(rough));
  scene.add_sphere("at its corner", 0.1, {});
  scene.add_box("known", {1, 1, 1}, {.is_static = true, .pose = Pose{{50, 0, 0}}});
  scene.add_sphere("at its face", 0.1, {});
  const double far = 0.3 * std::sqrt(3.0) - 0.1;  // of the first ball; its box is nearer
  const std::vector<std::uint32_t> bodies{1, 3};
  const std::vector<BodyPair> pairs{{0, 1}, {2, 3}};
  const std::vector<Pose> poses{{{0.8, 0.8, 0.8}}, {{50 + 0.5 + 0.1 + far + 0.005, 0, 0}}};
  const engine::Engine cpu(std::move(scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = 1;
  q.reduce = Reduce::kMin;
  q.fields = kAllFields | kFieldPairLower;
  HostReduction reduction(cpu, q);
  EXPECT_EQ(reduction.compare("a rough box"), 0u);
  EXPECT_EQ(reduction.rows().pair[0], pairs[1]) << "5 mm farther, and 5 mm nearer at most";
  EXPECT_EQ(reduction.rows().pair_lower[0], pairs[0]);
}

}  // namespace
}  // namespace clearance::test
