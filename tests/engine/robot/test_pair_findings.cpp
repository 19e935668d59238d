// Classification of links that touch always, never or sometimes: robots with spherical links, whose result is known by
// construction.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "engine/robot/pair_findings.h"

namespace clearance {
namespace {

// A planar arm: `links` joints about z, 0.5 m apart, each within `limit` radians, and a sphere at each link's end.
class FlatArm {
 public:
  FlatArm(int links, double limit, double radius) : model_(model(links, limit)), kinematics_(model_), radius_(radius) {}

  Found find(std::uint32_t a, std::uint32_t b, const FindingOptions& options = {}) {
    const LinkBall ball{{0.5, 0, 0}, radius_};
    const PairDistances distances = [&](std::span<const double> positions, std::span<SignedBounds> bounds) {
      const std::vector<Pose> roots(1);
      std::vector<Pose> poses(bounds.size() * model_.links.size());
      std::vector<Status> status(bounds.size());
      kinematics_.place(positions, roots, poses, status);
      for (std::size_t k = 0; k < bounds.size(); ++k) {
        const auto centre = [&](std::uint32_t link) {
          const Pose& X = poses[k * model_.links.size() + link];
          return X.translation + turned(Quaternion<double>{X.qw, X.qx, X.qy, X.qz}, Vec3d{0.5, 0, 0});
        };
        const double distance = norm(centre(a) - centre(b)) - 2 * radius_;
        bounds[k] = {distance - 1e-12, distance + 1e-12};
        ++looks_;
      }
    };
    return find_pair(model_, kinematics_, {a, b, ball, ball}, distances, options);
  }
  int looks() const { return looks_; }
  const RobotModel& robot() const { return model_; }

 private:
  static RobotModel model(int links, double limit) {
    std::string text = "<robot name='flat'><link name='l0'/>";
    for (int n = 1; n <= links; ++n) {
      const std::string before = "l" + std::to_string(n - 1), link = "l" + std::to_string(n);
      text += "<link name='" + link + "'/><joint name='j" + std::to_string(n) + "' type='revolute'><parent link='" +
              before + "'/><child link='" + link + "'/><origin xyz='0.5 0 0'/><axis xyz='0 0 1'/><limit lower='" +
              std::to_string(-limit) + "' upper='" + std::to_string(limit) + "'/></joint>";
    }
    return parse_urdf(text + "</robot>", "flat.urdf");
  }

  RobotModel model_;
  Kinematics kinematics_;
  double radius_;
  int looks_ = 0;
};

TEST(PairFindings, NeighboursAreAdjacent) {
  FlatArm arm(3, 1, 0.1);
  EXPECT_EQ(arm.find(1, 2).finding, PairFinding::kAdjacent);
  EXPECT_EQ(arm.looks(), 0);
}

TEST(PairFindings, WhatCannotTouchIsProvedSo) {
  FlatArm arm(3, 1, 0.1);  // two bends of 1 rad leave the spheres at least 2 * 0.5 cos(0.5) - 0.2 m apart
  const Found found = arm.find(1, 3);
  EXPECT_EQ(found.finding, PairFinding::kNever);
  EXPECT_GT(found.steps, 0u);
  FlatArm longer(4, 0.5, 0.1);
  EXPECT_EQ(longer.find(1, 4).finding, PairFinding::kNever);
}

TEST(PairFindings, WhatAlwaysTouchesIsProvedSo) {
  FlatArm arm(3, 0.3, 0.6);
  EXPECT_EQ(arm.find(1, 3).finding, PairFinding::kAlways);
}

TEST(PairFindings, WhatDoesBothIsReported) {
  FlatArm arm(3, 3, 0.2);
  EXPECT_EQ(arm.find(1, 3).finding, PairFinding::kSometimes);
}

// They touch only if two joints are both within a hair of a limit: no sample finds it, but the proof must.
TEST(PairFindings, AProofFindsWhatNoSampleSees) {
  // l1's end to l3's end: |1 + e^(i t)| / 2 = cos(t / 2) of the joint between, at least 0.2 in all once t reaches
  // 2.7388.
  const double touching = 2 * std::acos(0.2), limit = touching + 1e-3;
  FlatArm arm(3, limit, 0.1);
  FindingOptions few;
  few.samples = 20;
  const Found found = arm.find(1, 3, few);
  EXPECT_EQ(found.finding, PairFinding::kSometimes) << "seen by the proof's own looks";
  EXPECT_GT(found.steps, 0u);
  FlatArm just_short(3, touching - 1e-3, 0.1);
  EXPECT_EQ(just_short.find(1, 3, few).finding, PairFinding::kNever);
}

TEST(PairFindings, WhereTheProofEndsItIsOnlySeen) {
  FlatArm arm(6, 0.7, 0.01);
  FindingOptions options;
  options.most_steps = 3;
  const Found found = arm.find(1, 6, options);
  EXPECT_EQ(found.finding, PairFinding::kNeverSeen);
  EXPECT_LE(found.steps, options.most_steps);
}

TEST(PairFindings, WithAMarginNearIsTouching) {
  FlatArm arm(3, 1, 0.1);  // at least 2 * 0.5 cos(0.5) - 0.2 = 0.678 m apart, at most 0.8 m
  FindingOptions options;
  const auto within = [&](double margin) {
    options.margin = margin;
    return arm.find(1, 3, options).finding;
  };
  EXPECT_EQ(within(0.67), PairFinding::kNever);
  EXPECT_EQ(within(0.7), PairFinding::kSometimes);
  EXPECT_EQ(within(0.81), PairFinding::kAlways);
}

TEST(PairFindings, SlidingWithoutLimitsIsRejected) {
  const RobotModel robot = parse_urdf(R"(<robot name='cart'><link name='a'/><link name='b'/><link name='c'/>
    <joint name='on' type='planar'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>
    <joint name='over' type='continuous'><parent link='b'/><child link='c'/></joint></robot>)",
                                      "cart.urdf");
  const Kinematics kinematics(robot);
  const PairDistances none = [](std::span<const double>, std::span<SignedBounds>) { FAIL(); };
  try {
    find_pair(robot, kinematics, {robot.find_link("a"), robot.find_link("c"), {}, {}}, none, {});
    FAIL();
  } catch (const RobotError& error) {
    EXPECT_STREQ(error.what(),
                 "joint \"on/x\" slides without limits: pairs that it never brings into contact cannot be found");
  }
}

}  // namespace
}  // namespace clearance
