// Poses of links compared with 60 digits: the error never exceeds its bound, and the bound is small.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "engine/robot/lane_kinematics.h"
#include "engine/robot/link_twists.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

using test::Real;
using test::RealFrame;
using test::RobotRandom;

const std::string kFolder = source_file("tests/engine/robot/");

// Text of a URDF: a chain of joints of any kind with occasional side branches, and mimics of the first one.
std::string random_urdf(RobotRandom& random, int joints) {
  std::string text = "<robot name='r'><link name='l0'/>";
  const auto numbers = [&](double most) {
    char out[100];
    const bool square = random.below(2) == 0;
    const auto one = [&] { return square ? (random.below(3) - 1) * most / 2 : random.uniform(-most, most); };
    std::snprintf(out, sizeof out, "%.17g %.17g %.17g", one(), one(), one());
    return std::string(out);
  };
  for (int j = 1; j <= joints; ++j) {
    const int parent = random.below(4) == 0 ? random.below(j) : j - 1;
    const int kind = j == 1 ? 1 : random.below(8);
    const char* type = kind == 0 ? "fixed" : kind < 5 ? "continuous" : kind < 7 ? "prismatic" : "planar";
    text += "<link name='l" + std::to_string(j) + "'/><joint name='j" + std::to_string(j) + "' type='" + type +
            "'><parent link='l" + std::to_string(parent) + "'/><child link='l" + std::to_string(j) +
            "'/><origin xyz='" + (random.below(4) == 0 ? "0 0 0" : numbers(0.5)) + "' rpy='" +
            numbers(3.1415926535897931) + "'/>";
    if (kind == 7) text += "<axis xyz='0 0 1'/>";
    if (kind > 0 && kind < 7) text += std::string("<axis xyz='") + (random.below(2) ? "0 0 1" : "0.3 -2 1e-3") + "'/>";
    if (kind > 1 && kind < 7 && random.below(4) == 0) text += "<mimic joint='j1' multiplier='-0.7' offset='0.1'/>";
    text += "<limit lower='-1' upper='1'/></joint>";
  }
  return text + "</robot>";
}

struct OracleResult {
  double worst = 0, worst_between = 0;  // error over bound
  double claim_over_reach = 0;
  int checked = 0;
};

// Some configurations of a robot, each link and many pairs of links.
void check_robot(const RobotModel& robot, RobotRandom& random, int configurations, double angle, double travel,
                 double far, OracleResult* out) {
  const Kinematics kinematics(robot);
  constexpr double kRadius = 0.2, kOraclesOwn = 1e-50;
  std::vector<Pose> roots;
  double distance = 0;
  for (std::size_t r = 0; r < kinematics.roots().size(); ++r) {
    roots.push_back(random.pose(far, std::pow(10.0, random.uniform(-3, 3))));
    distance = std::max(distance, norm(roots.back().translation));
  }
  std::vector<double> q;
  for (int k = 0; k < configurations; ++k)
    for (const RobotColumn& column : robot.columns) {
      const JointKind kind = robot.joints[column.joint].kind;
      const bool slides =
          kind == JointKind::kPrismatic || (kind == JointKind::kPlanar && !column.name.ends_with("/theta"));
      q.push_back(random.uniform(-1, 1) * (slides ? travel : angle));
    }
  std::vector<Pose> poses(configurations * robot.links.size());
  std::vector<Status> status(configurations);
  kinematics.place(q, roots, poses, status);
  for (int k = 0; k < configurations; ++k) {
    ASSERT_EQ(status[k], Status::kOk);
    const double most = kinematics.travel(std::span(q).subspan(k * robot.columns.size(), robot.columns.size()));
    const std::vector<RealFrame> exact =
        test::real_links(robot, q.data() + k * robot.columns.size(), kinematics.roots(), roots);
    std::vector<RealFrame> got;
    for (std::size_t l = 0; l < robot.links.size(); ++l)
      got.push_back(test::real_frame(poses[k * robot.links.size() + l]));
    for (std::uint32_t l = 0; l < robot.links.size(); ++l) {
      const double off = test::displacement(exact[l], got[l], kRadius);
      const double claim = kinematics.error(l, kRadius).at(most, distance);
      ASSERT_LE(off, claim + kOraclesOwn) << robot.links[l].name;
      if (claim > 0) out->worst = std::max(out->worst, off / claim);
      out->claim_over_reach = std::max(out->claim_over_reach, claim / (kinematics.reach(l, kRadius) + most + distance));
      ++out->checked;
      const auto b = static_cast<std::uint32_t>(random.below(static_cast<int>(robot.links.size())));
      if (b == l) continue;
      // Position of b relative to a: b's origin moves with a's frame like a's points at that distance.
      const double between =
          test::displacement(test::real_inverse(exact[l]) * exact[b], test::real_inverse(got[l]) * got[b], 0);
      const double far_b =
          norm(poses[k * robot.links.size() + b].translation - poses[k * robot.links.size() + l].translation) *
          (1 + 1e-9);
      const double whole = kinematics.error_between(l, far_b, b, 0).at(most, distance);
      ASSERT_LE(between, whole + kOraclesOwn) << robot.links[l].name << " and " << robot.links[b].name;
      if (whole > 0) out->worst_between = std::max(out->worst_between, between / whole);
    }
  }
}

void say(const char* what, const OracleResult& checked) {
  std::printf("%s: %d poses, worst error %.3f of the claim (between links %.3f), claim at most %.3g of the reach\n",
              what, checked.checked, checked.worst, checked.worst_between, checked.claim_over_reach);
}

TEST(Kinematics, AnArmIsWithinWhatIsClaimedAndThatIsLittle) {
  RobotRandom random(1);
  OracleResult checked;
  check_robot(read_urdf(kFolder + "arm.urdf"), random, 60, 3, 0.5, 0, &checked);
  say("arm", checked);
  EXPECT_LT(checked.claim_over_reach, 3e-14);
  EXPECT_GT(checked.worst, 0.02) << "the claim is not idle";
}

TEST(Kinematics, EveryKindOfJointIsWithinWhatIsClaimed) {
  RobotRandom random(2);
  OracleResult checked;
  check_robot(read_urdf(kFolder + "every_joint.urdf"), random, 60, 3, 0.5, 1, &checked);
  say("every joint", checked);
  EXPECT_LT(checked.claim_over_reach, 3e-14);
  EXPECT_GT(checked.worst_between, 0.005);
}

TEST(Kinematics, RandomRobotsAreWithinWhatIsClaimed) {
  RobotRandom random(3);
  OracleResult near, far;
  for (int i = 0; i < 25; ++i) {
    const RobotModel robot = parse_urdf(random_urdf(random, 2 + i % 10), "random.urdf");
    check_robot(robot, random, 6, 4, 1, 1, &near);
    check_robot(robot, random, 4, 1e5, 100, 1e4, &far);
  }
  say("random", near);
  say("random, many turns and far away", far);
  EXPECT_GT(near.checked, 500);
  EXPECT_LT(near.claim_over_reach, 3e-14);
}

// An arm with a distant base: the relative error of its links depends on the base's own digits, not on all joints.
TEST(Kinematics, NeighboursShareWhatCarriesThem) {
  const RobotModel robot = read_urdf(kFolder + "arm.urdf");
  const Kinematics kinematics(robot);
  const std::uint32_t last = robot.joints.back().child, before = robot.joints.back().parent;
  const double alone = kinematics.error(last, 0.2).at(0, 0);
  EXPECT_LT(kinematics.error_between(before, 0.2, last, 0.2).at(0, 0), 0.2 * alone);
  EXPECT_EQ(kinematics.error_between(last, 0.2, last, 0.2).at(1, 1), 0) << "a link is rigid";
  EXPECT_EQ(kinematics.error(robot.base, 0.2).at(1, 1), 0) << "the base is where it is said to be";
}

TEST(Kinematics, AllInstructionSetsGiveTheSameBits) {
  RobotRandom random(4);
  for (const char* file : {"arm.urdf", "every_joint.urdf"}) {
    const RobotModel robot = read_urdf(kFolder + file);
    const Kinematics kinematics(robot);
    for (const std::size_t count : {1, 2, 3, 7, 8, 9, 31}) {
      std::vector<Pose> roots;
      for (std::size_t r = 0; r < kinematics.roots().size(); ++r) roots.push_back(random.pose(3, 1));
      std::vector<double> q(count * robot.columns.size());
      for (double& x : q) x = random.uniform(-1, 1) * (random.below(5) == 0 ? 1e6 : 3);
      const auto placed = [&](const KinematicKernel& kernel, std::size_t first, std::size_t rows) {
        std::vector<Pose> poses(rows * robot.links.size());
        std::vector<Status> status(rows);
        kinematics.place(std::span(q).subspan(first * robot.columns.size(), rows * robot.columns.size()), roots, poses,
                         status, kernel);
        return poses;
      };
      const std::vector<Pose> alone = placed(kinematic_kernels().back(), 0, count);
      ASSERT_EQ(kinematic_kernels().back().name, "scalar");
      ASSERT_GE(kinematic_kernels().size(), 2u);
      for (const KinematicKernel& kernel : kinematic_kernels()) {
        EXPECT_EQ(std::memcmp(placed(kernel, 0, count).data(), alone.data(), alone.size() * sizeof(Pose)), 0)
            << kernel.name << ", " << count << " configurations of " << file;
        for (std::size_t k = 0; k < count; ++k)  // lanes are joints
          EXPECT_EQ(std::memcmp(placed(kernel, k, 1).data(), &alone[k * robot.links.size()],
                                robot.links.size() * sizeof(Pose)),
                    0)
              << kernel.name << ", configuration " << k << " of " << count << " of " << file;
      }
    }
  }
}

// A bad configuration does not affect its neighbours in other lanes.
TEST(Kinematics, StatesInLanesHaveTheSameBitsAndTwists) {
  RobotRandom random(5);
  for (const char* file : {"arm.urdf", "every_joint.urdf"}) {
    const RobotModel robot = read_urdf(kFolder + file);
    const Kinematics kinematics(robot);
    std::vector<double> q(kMostLanes * robot.columns.size());
    std::vector<DoubleInLanes> positions(robot.columns.size());
    for (std::size_t c = 0; c < positions.size(); ++c)
      for (std::size_t k = 0; k < kMostLanes; ++k)
        q[k * positions.size() + c] = positions[c].lane[k] = random.uniform(-4, 4);
    std::vector<Pose> poses(kMostLanes * robot.links.size());
    std::vector<Status> status(kMostLanes);
    kinematics.place(q, {}, poses, status);
    std::vector<double> change(positions.size());
    for (double& each : change) each = random.uniform(-2, 2);
    const LinkTwists link_twists(kinematics);
    std::vector<Twist> twists(robot.links.size());
    for (const LaneFunctions& kernel : lane_kinematics()) {
      LaneKinematics lanes(kinematics);
      lanes.place(positions, kernel);
      lanes.take_twists(change, kernel);
      for (std::size_t k = 0; k < kMostLanes; ++k) {
        const std::span of_state = std::span(poses).subspan(k * robot.links.size(), robot.links.size());
        link_twists.at(of_state, change, twists);
        for (std::uint32_t link = 0; link < robot.links.size(); ++link) {
          const Pose pose = lanes.pose(link, k);
          const Twist twist = lanes.twist(link, k);
          EXPECT_EQ(std::memcmp(&pose, &of_state[link], sizeof pose), 0) << file << " " << link;
          EXPECT_EQ(std::memcmp(&twist, &twists[link], sizeof twist), 0) << file << " " << link;
        }
      }
    }
  }
}

TEST(Kinematics, PositionsThatCannotBeUsedAreBadPoses) {
  const RobotModel robot = read_urdf(kFolder + "every_joint.urdf");
  const Kinematics kinematics(robot);
  const std::vector<Pose> roots(kinematics.roots().size());
  const std::size_t columns = robot.columns.size(), links = robot.links.size();
  const std::vector<double> good(columns, 0.25);
  std::vector<Pose> alone(links);
  std::vector<Status> ok(1);
  kinematics.place(good, roots, alone, ok);
  for (const KinematicKernel& kernel : kinematic_kernels())
    for (std::size_t column = 0; column < columns; ++column)
      for (const double x :
           std::initializer_list<double>{NAN, INFINITY, -INFINITY, std::nextafter(1e6, 2e6), -1.1e6, 1e308}) {
        std::vector<double> q;
        for (int k = 0; k < 3; ++k) q.insert(q.end(), good.begin(), good.end());
        q[columns + column] = x;
        std::vector<Pose> poses(3 * links);
        std::vector<Status> status(3);
        kinematics.place(q, roots, poses, status, kernel);
        EXPECT_EQ(status, (std::vector{Status::kOk, Status::kBadPose, Status::kOk})) << kernel.name << " " << x;
        for (const std::size_t k : {0, 2})
          EXPECT_EQ(std::memcmp(&poses[k * links], alone.data(), links * sizeof(Pose)), 0);
        for (std::size_t l = 0; l < links; ++l) {
          const bool root = std::count(kinematics.roots().begin(), kinematics.roots().end(), l) > 0;
          EXPECT_EQ(check(poses[links + l]), root ? PoseQuality::kGood : PoseQuality::kBad);
        }
      }
  // A mimic joint's own position can be too large although that of the other is not.
  RobotModel scaled = robot;
  scaled.joints[robot.find_joint("lid")].mimic->multiplier = 1e6;
  std::vector<double> q = good;
  q[robot.find_column("turn")] = 2;
  std::vector<Status> status(1);
  Kinematics(scaled).place(q, roots, alone, status);
  EXPECT_EQ(status[0], Status::kBadPose);
  std::vector<DoubleInLanes> positions(columns);
  for (std::size_t c = 0; c < columns; ++c)
    for (std::size_t k = 0; k < kMostLanes; ++k) positions[c].lane[k] = k == 3 ? q[c] : good[c];
  const Kinematics of_scaled(scaled);
  for (const LaneFunctions& kernel : lane_kinematics()) {
    LaneKinematics lanes(of_scaled);
    lanes.place(positions, kernel);
    for (std::uint32_t link = 0; link < links; ++link)
      for (std::size_t k = 0; k < kMostLanes; ++k) {
        const bool root = std::count(of_scaled.roots().begin(), of_scaled.roots().end(), link) > 0;
        EXPECT_EQ(std::isnan(lanes.pose(link, k).translation.x), k == 3 && !root) << link << " " << k;
      }
  }
}

}  // namespace
}  // namespace clearance
