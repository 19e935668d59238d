// Balls that hit in earlier motions are tried first in later ones. That changes no verdict.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <tuple>
#include <vector>

#include "engine/cover/cover_store.h"
#include "engine/decision/motion_decider.h"
#include "engine/decision/state_lanes.h"
#include "engine/selection/configuration_poses.h"
#include "engine/selection/plan.h"
#include "engine/state/pose_store.h"
#include "tests/engine/crowded_arm.h"

namespace clearance::test {
namespace {

engine::Scene scene_of(bool with_held, bool with_loose) {
  engine::Scene scene = crowded_scene(!with_loose, with_held);
  if (with_loose) scene.add_sphere("loose", 0.1, {.pose = Pose{{0, 0, 8}}});
  return scene;
}

// The arm in the crowded scene with its covers, and states of it.
struct Crowded {
  engine::Scene scene;
  CoverStore covers;
  PoseStore poses{scene, std::chrono::seconds(60)};
  ArmStates arm;
  Plan plan;

  explicit Crowded(int states, bool with_held = true, bool with_loose = false)
      : scene(scene_of(with_held, with_loose)), arm(scene, states) {
    arm.query.fields = kFieldVerdict;
    for (const Body& body : scene.bodies())
      if (body.robot != kNone) covers.request({body.parts});
    EXPECT_TRUE(covers.wait(kCoversPatience));
  }
  const Plan& make() {
    plan = make_plan(arm.query, scene, poses.snapshot(), 1u << 20, true);
    plan.uncertainties = uncertainties_of(scene, *plan.snapshot, plan.begun_ns);
    return plan;
  }
};

/// Balls of the first packet that can be guessed.
std::uint32_t balls_of(const DecidedBody& body) {
  return body.is_direct && body.root_packets > 0 ? body.packets[0].count : 0;
}

/// The frames of bodies with poses of their own in eight states.
struct StatesInLanes {
  StatesInLanes(const DecisionView& view, std::span<const Pose> poses, std::size_t stride) : parts(view.body_count) {
    for (std::uint32_t b = 0; b < view.body_count; ++b) {
      frames.push_back(parts[b].data());
      for (std::size_t k = 0; k < 8 && view.bodies[b].is_direct; ++k) {
        const Pose& X = poses[k * stride + view.bodies[b].pose];
        const double numbers[7] = {X.qw, X.qx, X.qy, X.qz, X.translation.x, X.translation.y, X.translation.z};
        for (std::size_t i = 0; i < 7; ++i) parts[b][8 * i + k] = numbers[i];
      }
    }
  }

  std::vector<std::array<double, 56>> parts;
  std::vector<const double*> frames;
};

TEST(HitGuess, EarlierMotionsChangeNoVerdict) {
  constexpr std::uint32_t kMotions = 400;
  Crowded crowded(2 * kMotions);
  crowded.arm.query.max_evaluations = 64;
  const Plan& plan = crowded.make();
  const auto covers = CoverPlan::make(crowded.scene, plan, crowded.covers, nullptr);
  ASSERT_TRUE(covers && covers->rates());
  MotionDecider onwards(*covers, plan), backwards(*covers, plan);
  std::vector<Verdict> verdicts;
  std::size_t hits = 0;
  for (std::uint32_t i = 0; i < kMotions; ++i) {
    verdicts.push_back(onwards.decide(i));
    hits += verdicts.back() == Verdict::kHit;
    EXPECT_EQ(MotionDecider(*covers, plan).decide(i), verdicts.back()) << i;
  }
  for (std::uint32_t i = kMotions; i-- > 0;) EXPECT_EQ(backwards.decide(i), verdicts[i]) << i;
  EXPECT_GT(hits, 50u);
  EXPECT_GT(onwards.guessed(), 20u);
  EXPECT_GT(backwards.guessed(), 20u);
}

TEST(HitGuess, IsTheSameInEveryInstructionSetAndTrue) {
  constexpr std::uint32_t kStates = 512, kTogether = 8;
  Crowded crowded(kStates);
  const Plan& plan = crowded.make();
  const auto covers = CoverPlan::make(crowded.scene, plan, crowded.covers, nullptr);
  ASSERT_TRUE(covers);
  const DecisionView& view = covers->view();
  ConfigurationPoses at(plan);
  const auto block = at.at(0, kStates);
  const std::vector<std::uint8_t> usable(kStates, 1);
  std::vector<Decision> decisions(kStates);
  std::vector<std::uint64_t> open(kStates * std::size_t{plan.pairs.size()});
  decision_kernels()[0].run({&view, block.poses.data(), plan.bodies.size(), kStates, usable.data(), true},
                            {decisions.data(), open.data(), static_cast<std::uint32_t>(open.size())});
  const engine::Engine by_parts(crowded_scene(), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  QueryView all = crowded.arm.query;
  all.reduce = Reduce::kNone;
  all.fields = kFieldLower;
  const Answer exact = evaluate(by_parts, all);
  ASSERT_EQ(exact.size.rows, kStates * plan.pairs.size());
  std::size_t guessed = 0;
  for (std::uint32_t first = 0; first < kStates; first += kTogether) {
    const StatesInLanes lanes(view, block.poses.subspan(first * plan.bodies.size()), plan.bodies.size());
    for (std::uint32_t b = 0; b < view.body_count; ++b)
      for (std::uint32_t o = 0; o < view.obstacle_count; ++o)
        for (std::uint32_t ball = 0; ball < balls_of(view.bodies[b]); ++ball) {
          const BallHit hit{o, b, 0, ball};
          const HitGuess guess{&view, lanes.frames.data(), kTogether, {&hit, 1}};
          const GuessedHit found = decision_kernels()[0].guess_hit(guess);
          for (const DecisionKernel& kernel : decision_kernels()) {
            const GuessedHit same = kernel.guess_hit(guess);
            EXPECT_EQ(same.hit, found.hit) << kernel.name;
            EXPECT_EQ(same.state, found.state) << kernel.name;
          }
          if (!found.hit) continue;
          ++guessed;
          const std::size_t state = first + found.state;
          EXPECT_EQ(decisions[state].verdict, Verdict::kHit);
          const std::uint64_t position = view.position[std::size_t{o} * view.columns + b];
          EXPECT_LE(exact.view.lower[state * plan.pairs.size() + position], plan.margins.of(position));
        }
  }
  EXPECT_GT(guessed, 20u);
}

// One state after another by poses, and eight side by side by frames: the same decisions, to the open pairs.
TEST(StateLanes, DecideAsPosesDo) {
  constexpr std::uint32_t kStates = 203;
  Crowded crowded(kStates, false);
  const std::size_t joints = crowded.arm.query.joints.size(), bad = 17;
  std::vector<double> positions(crowded.arm.query.positions.begin(), crowded.arm.query.positions.end());
  positions[bad * joints + 1] = std::numeric_limits<double>::quiet_NaN();
  crowded.arm.query.positions = positions;
  const Plan& plan = crowded.make();
  const auto covers = CoverPlan::make(crowded.scene, plan, crowded.covers, nullptr);
  ASSERT_TRUE(covers);
  const DecisionView& view = covers->view();
  StateLanes lanes(*covers, plan);
  ASSERT_TRUE(lanes.can_place());
  ConfigurationPoses at(plan);
  const auto block = at.at(0, kStates);
  std::array<std::size_t, 3> seen{};
  for (const DecisionKernel& kernel : decision_kernels())
    for (std::uint32_t k = 0; k < kStates; ++k) {
      if (k % kMostLanes == 0) lanes.place(k, std::min<std::size_t>(kMostLanes, kStates - k));
      const auto decide = [&](const DecisionBatch& batch, std::uint32_t state) {
        std::vector<Decision> decisions(batch.states);
        std::vector<std::uint64_t> open(batch.states * std::size_t{plan.pairs.size()});
        kernel.run(batch, {decisions.data(), open.data(), static_cast<std::uint32_t>(open.size())});
        const Decision& d = decisions[state];
        return std::tuple(d.verdict, d.is_listed, d.hit,
                          std::vector<std::uint64_t>(open.begin() + d.open_begin, open.begin() + d.open_end));
      };
      const std::uint8_t usable = k != bad;
      const auto by_pose =
          decide({&view, &block.poses[k * plan.bodies.size()], plan.bodies.size(), 1, &usable, false}, 0);
      const std::size_t together = std::min<std::size_t>(kMostLanes, kStates - k / kMostLanes * kMostLanes);
      const auto by_frame =
          decide({&view, nullptr, 0, together, lanes.usable(), false, nullptr, 0, lanes.frames()}, k % kMostLanes);
      EXPECT_EQ(by_pose, by_frame) << kernel.name << " " << k;
      EXPECT_EQ(lanes.usable()[k % kMostLanes], usable) << k;
      ++seen[static_cast<std::size_t>(std::get<0>(by_frame))];
    }
  for (const std::size_t count : seen) EXPECT_GT(count, 0u);
  for (std::uint32_t k = 0; k < kStates; ++k) {
    const Pose* const poses = lanes.place_one(k);
    EXPECT_EQ(lanes.usable()[0], k != bad) << k;
    if (k == bad) continue;
    EXPECT_EQ(std::memcmp(poses, &block.poses[k * plan.bodies.size()], plan.bodies.size() * sizeof(Pose)), 0) << k;
  }
}

// A motion's spans side by side, or one after another where the query gives a body's poses, too: the same decisions, to
// the open pairs and their times.
TEST(SpansInLanes, AreDecidedAsAlone) {
  constexpr std::uint32_t kMotions = 3000;
  Crowded together(2 * kMotions, false, true), alone(2 * kMotions, false, true);
  const std::vector<std::uint32_t> loose{alone.scene.find_body("loose")};
  const std::vector<Pose> far(2 * kMotions, Pose{{0, 0, 8}});
  const std::size_t joints = alone.arm.joints.size();
  for (std::size_t i = 0; i < kMotions * joints; ++i)  // a quarter of the way
    for (Crowded* each : {&together, &alone}) {
      double* const start = &each->arm.positions[i / joints * 2 * joints + i % joints];
      start[joints] = start[0] + 0.25 * (start[joints] - start[0]);
    }
  alone.arm.query.bodies = loose;
  alone.arm.query.configurations = far;
  std::vector<BodyPair> pairs;
  std::array<std::size_t, 3> seen{};
  std::size_t open = 0;
  for (const double margin : {0.0, 0.02}) {
    for (Crowded* each : {&together, &alone}) {
      each->arm.query.max_evaluations = 64;
      each->arm.query.margin = margin;
      each->make();
      pairs.resize(together.plan.pairs.size());
      together.plan.pairs.copy(0, pairs.size(), pairs.data());
      std::erase_if(pairs, [&](const BodyPair& pair) { return pair.a == loose[0] || pair.b == loose[0]; });
      each->arm.query.pairs = pairs;
      each->arm.query.all_pairs = false;
      each->make();
    }
    ASSERT_EQ(alone.plan.given_bodies, 1u);
    ASSERT_EQ(alone.plan.pairs.size(), together.plan.pairs.size());
    const auto covers = CoverPlan::make(together.scene, together.plan, together.covers, nullptr),
               same = CoverPlan::make(alone.scene, alone.plan, alone.covers, nullptr);
    ASSERT_TRUE(covers && covers->rates() && same && same->rates());
    for (std::uint32_t i = 0; i < kMotions; ++i) {
      MotionDecider in_lanes(*covers, together.plan), one_by_one(*same, alone.plan);
      const Verdict verdict = in_lanes.decide(i);
      EXPECT_EQ(verdict, one_by_one.decide(i)) << margin << " " << i;
      ++seen[static_cast<std::size_t>(verdict)];
      if (verdict != Verdict::kUnresolved) continue;
      ASSERT_EQ(in_lanes.open().size(), one_by_one.open().size()) << margin << " " << i;
      open += in_lanes.open().size();
      for (std::size_t k = 0; k < in_lanes.open().size(); ++k) {
        const OpenPair &a = in_lanes.open()[k], &b = one_by_one.open()[k];
        EXPECT_EQ(std::tie(a.position, a.begin, a.end), std::tie(b.position, b.begin, b.end)) << margin << " " << i;
      }
    }
  }
  for (const std::size_t count : seen) EXPECT_GT(count, 20u);
  EXPECT_GT(open, 20u);
}

}  // namespace
}  // namespace clearance::test
