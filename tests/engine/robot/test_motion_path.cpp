// Motion of links compared with 60 digits: never more than the bound, and the bound is attained.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/robot/motion_path.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/engine/robot/flat_arm.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

using test::Real;
using test::RealFrame;
using test::RealVec;
using test::RobotRandom;

const std::string kRobots = source_file("tests/engine/robot/");

RealVec at(const RealFrame& X, const Vec3d& p) {
  return (X * test::real_shift(p.x, p.y, p.z)).t;
}

Real apart(const RealVec& p, const RealVec& q) {
  Real sum = 0;
  for (int i = 0; i < 3; ++i) sum += (p.x[i] - q.x[i]) * (p.x[i] - q.x[i]);
  return sqrt(sum);
}

bool slides(const RobotModel& robot, std::uint32_t column) {
  const JointKind kind = robot.joints[robot.columns[column].joint].kind;
  return kind == JointKind::kPrismatic ||
         (kind == JointKind::kPlanar && !robot.columns[column].name.ends_with("/theta"));
}

std::vector<double> random_positions(const RobotModel& robot, RobotRandom& random) {
  std::vector<double> q;
  for (std::uint32_t c = 0; c < robot.columns.size(); ++c)
    q.push_back(random.uniform(-1, 1) * (slides(robot, c) ? 0.5 : 3));
  return q;
}

// Two configurations of a robot, exact, and bounds on the change between them.
struct Step {
  std::vector<double> change;
  double travel;
  std::vector<RealFrame> from, to;

  Step(const RobotModel& robot, const Kinematics& kinematics, const std::vector<double>& a,
       const std::vector<double>& b)
      : travel(std::max(kinematics.travel(a), kinematics.travel(b))) {
    for (std::size_t c = 0; c < a.size(); ++c) change.push_back(std::abs(b[c] - a[c]) * (1 + 1e-15));
    const std::vector<Pose> roots(kinematics.roots().size());
    from = test::real_links(robot, a.data(), kinematics.roots(), roots);
    to = test::real_links(robot, b.data(), kinematics.roots(), roots);
  }
  Real way(std::uint32_t link, const Vec3d& p) const { return apart(at(from[link], p), at(to[link], p)); }
  Real way_seen_from(std::uint32_t eye, std::uint32_t link, const Vec3d& p) const {
    return apart(at(test::real_inverse(from[eye]) * from[link], p), at(test::real_inverse(to[eye]) * to[link], p));
  }
};

constexpr double kOraclesOwn = 1e-50;

Real ratio(const Real& way, double claim) {
  return claim > 0 ? way / claim : way < kOraclesOwn ? Real(0) : Real(2);
}

// Small and large steps of random robots: no point of a ball moves farther than its path's bound.
void check_robot(const RobotModel& robot, RobotRandom& random, int steps, double* worst) {
  const Kinematics kinematics(robot);
  const auto links = static_cast<std::uint32_t>(robot.links.size());
  for (int k = 0; k < steps; ++k) {
    const std::vector<double> a = random_positions(robot, random), other = random_positions(robot, random);
    const double size = std::pow(10.0, random.uniform(-4, 0));
    std::vector<double> b = a;
    for (std::size_t c = 0; c < a.size(); ++c)
      if (random.below(2)) b[c] += (other[c] - a[c]) * size;
    const Step step(robot, kinematics, a, b);
    for (std::uint32_t link = 0; link < links; ++link) {
      const LinkBall ball{random.direction() * random.uniform(0, 0.3), random.below(2) ? 0.1 : 0};
      const MotionPath path(kinematics, link, ball);
      const auto eye = static_cast<std::uint32_t>(random.below(static_cast<int>(links)));
      for (int n = 0; n < 3; ++n) {
        const Vec3d p = ball.centre + random.direction() * (ball.radius * (1 - 1e-12));
        const Real seen = ratio(step.way(link, p), path.way(step.change, step.travel));
        ASSERT_LE(seen, 1) << robot.links[link].name;
        *worst = std::max(*worst, static_cast<double>(seen));
        if (kinematics.roots().size() > 1) continue;  // seen from one root only
        const MotionPath from_eye(kinematics, eye, link, ball);
        ASSERT_LE(ratio(step.way_seen_from(eye, link, p), from_eye.way(step.change, step.travel)), 1)
            << robot.links[link].name << " seen from " << robot.links[eye].name;
      }
    }
  }
}

TEST(MotionPath, NoPointGoesFartherThanItsPath) {
  RobotRandom random(1);
  for (const char* file : {"arm.urdf", "every_joint.urdf"}) {
    double worst = 0;
    check_robot(read_urdf(kRobots + file), random, 40, &worst);
    std::printf("%s: longest way %.3f of the claim\n", file, worst);
    EXPECT_GT(worst, 0.5) << "the claim is not idle";
  }
}

// Two links come no nearer than the least bound of their paths, on which proofs depend.
TEST(MotionPath, NoTwoPointsComeNearerThanAnyPathBetweenThem) {
  RobotRandom random(2);
  for (const char* file : {"arm.urdf", "every_joint.urdf"}) {
    const RobotModel robot = read_urdf(kRobots + file);
    const Kinematics kinematics(robot);
    const auto links = static_cast<std::uint32_t>(robot.links.size());
    int paths = 0;
    for (int k = 0; k < 40; ++k) {
      const std::vector<double> a = random_positions(robot, random);
      std::vector<double> b = random_positions(robot, random);
      if (k % 2)
        for (std::size_t c = 0; c < a.size(); ++c) b[c] = a[c] + (b[c] - a[c]) * 1e-3;
      const Step step(robot, kinematics, a, b);
      for (std::uint32_t i = 0; i < links; ++i) {
        const auto j = static_cast<std::uint32_t>(random.below(static_cast<int>(links)));
        const LinkBall of_i{{0.1, 0, 0.05}, 0.1}, of_j{{0, -0.2, 0}, 0.02};
        const Vec3d p = of_i.centre + random.direction() * 0.0999, q = of_j.centre + random.direction() * 0.0199;
        const Real before = apart(at(step.from[i], p), at(step.from[j], q));
        const Real after = apart(at(step.to[i], p), at(step.to[j], q));
        for (const MotionPath& path : paths_between(kinematics, i, of_i, j, of_j)) {
          ASSERT_LE(abs(before - after), Real(path.way(step.change, step.travel)) + kOraclesOwn)
              << robot.links[i].name << " and " << robot.links[j].name;
          ++paths;
        }
      }
    }
    EXPECT_GT(paths, 500);
  }
}

// A stretched planar arm: its tip moves as far as a bound that sums reaches. Each joint is moved alone and all of them
// together, seen from the world and from the tip, so that the test detects a bound that is too small by a thousandth.
TEST(MotionPath, TheBoundIsAttained) {
  const RobotModel robot = test::flat_arm();
  const Kinematics kinematics(robot);
  const LinkBall ball{{0.1, 0, 0}, 0.05};
  const Vec3d outmost{0.15, 0, 0};
  const std::uint32_t tip = robot.find_link("tip"), base = robot.find_link("base");
  const std::uint32_t one = robot.find_column("one"), out = robot.find_column("out"),
                      three = robot.find_column("three");
  std::vector<double> straight(robot.columns.size(), 0);
  straight[out] = 0.25;
  int tried = 0;
  for (const std::vector<std::uint32_t>& moved :
       std::vector<std::vector<std::uint32_t>>{{one}, {out}, {three}, {one, three}}) {
    std::vector<double> q = straight;
    for (const std::uint32_t column : moved) q[column] += 1e-4;
    const Step step(robot, kinematics, straight, q);
    const Real seen = ratio(step.way(tip, outmost), MotionPath(kinematics, tip, ball).way(step.change, step.travel));
    EXPECT_LE(seen, 1);
    EXPECT_GT(seen, 0.999) << robot.columns[moved[0]].name;
    // The base seen from the tip, 0.3 m to the side of its place in the plane.
    const LinkBall foot{{-0.1, 0, 0.3}, 0};
    const Real back = ratio(step.way_seen_from(tip, base, foot.centre),
                            MotionPath(kinematics, tip, base, foot).way(step.change, step.travel));
    EXPECT_LE(back, 1);
    EXPECT_GT(back, 0.999) << robot.columns[moved[0]].name << " from the tip";
    ++tried;
  }
  EXPECT_EQ(tried, 4);
}

// Only joints between two links move one relative to the other.
TEST(MotionPath, JointsThatCarryBothDoNotCount) {
  const RobotModel robot = read_urdf(kRobots + "arm.urdf");
  const Kinematics kinematics(robot);
  const std::uint32_t left = robot.find_link("left_finger"), right = robot.find_link("right_finger"),
                      palm = robot.find_link("palm"), flange = robot.find_link("flange");
  const auto columns = [&](const MotionPath& path) {
    std::vector<std::string> names;
    for (const Mover& mover : path.movers()) names.push_back(robot.columns[mover.column].name);
    return names;
  };
  EXPECT_EQ(columns({kinematics, left, right, {}}), (std::vector<std::string>{"grip", "grip"}));
  EXPECT_EQ(columns({kinematics, palm, left, {}}), (std::vector<std::string>{"joint7", "grip"}));
  EXPECT_EQ(columns({kinematics, left, palm, {}}), (std::vector<std::string>{"grip", "joint7"}));
  EXPECT_EQ(columns({kinematics, flange, palm, {}}), (std::vector<std::string>{"joint7"}));
  EXPECT_EQ(columns({kinematics, robot.find_link("upper"), {}}), (std::vector<std::string>{"joint1", "joint2"}));
  EXPECT_TRUE(columns({kinematics, left, left, {}}).empty());
  EXPECT_EQ(paths_between(kinematics, left, {}, right, {}).size(), 3u);
}

}  // namespace
}  // namespace clearance
