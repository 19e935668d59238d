// Tightness of bounds on motion: each term of the claimed approach is attained to a thousandth, so that a bound that is
// too small fails here.
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>

#include "engine/motion/half_spans.h"
#include "engine/robot/motion_path.h"
#include "tests/engine/motion/motion_test.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/engine/robot/flat_arm.h"
#include "tests/source_file.h"
#include "tests/temporary_folder.h"

namespace clearance::test {
namespace {

constexpr double kOwnRounding = 1e-12;

// --- Speeds and accelerations of a path, compared with differences in 60 digits.

const std::string kRobots = source_file("tests/engine/robot/");

Real length(const RealVec& v) {
  return sqrt(v.x[0] * v.x[0] + v.x[1] * v.x[1] + v.x[2] * v.x[2]);
}

// Velocity and acceleration of a point while positions change by `change` per unit of time.
struct Derivatives {
  Real speed, acceleration;

  Derivatives(const RobotModel& robot, const Kinematics& kinematics, const std::vector<double>& q,
              const std::vector<double>& change, std::uint32_t eye, std::uint32_t link, const Vec3d& p) {
    const Real step("1e-15");
    RealVec at[3];
    for (int k = 0; k < 3; ++k) {
      std::vector<Real> moved;
      for (std::size_t c = 0; c < q.size(); ++c) moved.push_back(q[c] + (k - 1) * step * change[c]);
      const std::vector<Pose> roots(kinematics.roots().size());
      const auto links = real_links(robot, moved.data(), kinematics.roots(), roots);
      at[k] = (real_inverse(links[eye]) * links[link] * real_shift(p.x, p.y, p.z)).t;
    }
    RealVec first, second;
    for (int i = 0; i < 3; ++i) {
      first.x[i] = (at[2].x[i] - at[0].x[i]) / (2 * step);
      second.x[i] = (at[2].x[i] - 2 * at[1].x[i] + at[0].x[i]) / (step * step);
    }
    speed = length(first);
    acceleration = length(second);
  }
};

MotionRates claimed(const Kinematics& kinematics, const std::vector<double>& q, const std::vector<double>& change,
                    std::uint32_t eye, std::uint32_t link, const LinkBall& ball) {
  std::vector<double> sizes;
  for (const double c : change) sizes.push_back(std::abs(c));
  return MotionPath(kinematics, eye, link, ball).rates(sizes, kinematics.travel(q));
}

TEST(MotionRates, NoPointIsFasterOrAcceleratedByMore) {
  Random random(1);
  for (const char* file : {"arm.urdf", "every_joint.urdf"}) {
    const RobotModel robot = read_urdf(kRobots + file);
    const Kinematics kinematics(robot);
    const auto links = robot.links.size();
    int checked = 0;
    for (int k = 0; k < 150; ++k) {
      std::vector<double> q, change;
      for (std::size_t c = 0; c < robot.columns.size(); ++c) {
        q.push_back(random.uniform(-2, 2));
        change.push_back(random.below(3) ? random.uniform(-1, 1) : 0);
      }
      const auto eye = static_cast<std::uint32_t>(random.below(links)),
                 link = static_cast<std::uint32_t>(random.below(links));
      if (kinematics.root_of(eye) != kinematics.root_of(link)) continue;
      const Vec3d p{random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3)};
      const MotionRates claim = claimed(kinematics, q, change, eye, link, {p, 0});
      const Derivatives seen(robot, kinematics, q, change, eye, link, p);
      EXPECT_LE(seen.speed, claim.speed + 1e-20);
      EXPECT_LE(seen.acceleration, claim.acceleration + 1e-14);
      ++checked;
    }
    EXPECT_GT(checked, 80);
  }
}

// A flat, stretched arm attains the claimed bounds, for each joint alone and for several that add up.
TEST(MotionRates, AccelerationsAreAttained) {
  const RobotModel robot = flat_arm();
  const Kinematics kinematics(robot);
  const std::uint32_t base = robot.find_link("base"), tip = robot.find_link("tip");
  const std::size_t one = robot.find_column("one"), out = robot.find_column("out"), three = robot.find_column("three");
  struct Case {
    double one, out, three;
  };
  for (const Case& c : {Case{1, 0, 0}, {0, 0, 1}, {0.7, 0, 0.4}, {0.2, 0, 2}, {1e-3, 1, 0}, {1e-3, 1, 1e-3}}) {
    std::vector<double> q(robot.columns.size(), 0), change = q;
    change[one] = c.one, change[out] = c.out, change[three] = c.three;
    for (const bool back : {false, true}) {
      const std::uint32_t eye = back ? tip : base, link = back ? base : tip;
      const Vec3d p = back ? Vec3d{0, 0, 0.3} : Vec3d{0.15, 0, 0};
      const MotionRates claim = claimed(kinematics, q, change, eye, link, {p, 0});
      const Derivatives seen(robot, kinematics, q, change, eye, link, p);
      EXPECT_LE(seen.acceleration, claim.acceleration);
      EXPECT_GT(seen.acceleration, 0.998 * claim.acceleration)
          << c.one << ' ' << c.out << ' ' << c.three << ' ' << back;
    }
  }
}

// --- Bounds proved from the middle of a motion, compared with the distance at its end.

// A plate whose face points along `axis` (0 is x, 1 is y) from `at`.
void add_plate(engine::Scene& scene, const std::string& name, int axis, double at, const std::string& parent = {}) {
  const double thick = 0.1, wide = 10;
  Pose X;
  X.translation[axis] = at - 0.5 * thick;
  Vec3d size{wide, wide, wide};
  size[axis] = thick;
  scene.add_box(name, size, {.parent = parent, .pose = X});
}

void add_robot(engine::Scene& scene, const std::string& joints) {
  const TemporaryFolder folder;
  engine::RobotOptions options;
  options.urdf = folder.write("r.urdf", "<robot name='r'>" + joints + "</robot>");
  options.home.emplace();
  scene.add_robot("r", options);
}

std::string link(const std::string& name, double x = -1) {  // with a small ball if x >= 0
  if (x < 0) return "<link name='" + name + "'/>";
  return "<link name='" + name + "'><collision><origin xyz='" + std::to_string(x) +
         " 0 0'/><geometry><sphere radius='0.00001'/></geometry></collision></link>";
}
std::string joint(const std::string& name, const std::string& type, const std::string& from, const std::string& to,
                  double x, const std::string& axis, const std::string& more = "") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + from + "'/><child link='" + to +
         "'/><origin xyz='" + std::to_string(x) + " 0 0'/><axis xyz='" + axis + "'/>" + more +
         "<limit lower='-3' upper='3'/></joint>";
}

// A motion of two bodies that are nearest at one end.
struct Approach {
  engine::Scene scene;
  Motions motion;
  BodyPair pair;

  /// \param term contribution of the tested term, in metres
  void expect_bound(double term) {
    motion.pairs = {pair};
    const engine::Engine engine(std::move(scene), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
    QueryView query = motion.view(Reduce::kMin, 1);
    query.abs_tol = 1e-9;
    const Answer bound = evaluate(engine, query);
    query.max_evaluations = 0;  // both ends, as configurations
    query.abs_tol = 1e-10;
    query.fields = kDefaultFields;
    const Answer ends = evaluate(engine, query);
    const double least = std::min(ends.view.lower[0], ends.view.lower[1]) + 1e-9;
    EXPECT_LE(bound.view.lower[0], least);
    EXPECT_GE(bound.view.lower[0], least - 1e-3 * term - 2e-9);
    EXPECT_GT(bound.view.lower[0], 0);
    EXPECT_GT(term, 1e-6);
  }
};

const std::string kArmOfTwo = link("base") + link("upper") + link("tip", 0.5) +
                              joint("one", "revolute", "base", "upper", 0, "0 0 1") +
                              joint("two", "revolute", "upper", "tip", 0.5, "0 0 1");

Approach arm_at_plate(const std::string& robot, int axis, double gap, double from, const std::vector<double>& start,
                      const std::vector<double>& end) {
  Approach a;
  add_plate(a.scene, "plate", axis, from - 1e-5 - gap);
  add_robot(a.scene, robot);
  for (std::uint32_t j = 0; j < start.size(); ++j) a.motion.joints.push_back(j);
  a.motion.positions = start;
  a.motion.positions.insert(a.motion.positions.end(), end.begin(), end.end());
  a.pair = {a.scene.find_body("plate"), a.scene.find_body("r/tip")};
  return a;
}

TEST(MotionBounds, AJointsSpeed) {
  // The tip falls towards the plate, 1 m from the joint.
  arm_at_plate(kArmOfTwo, 1, 0.1, 0, {0.001, 0}, {-0.001, 0}).expect_bound(1e-3);
}
TEST(MotionBounds, AJointsAcceleration) {
  // The tip passes behind the plate, moving sideways.
  arm_at_plate(kArmOfTwo, 0, 0.1, 1, {-0.01, 0}, {0.01, 0}).expect_bound(5e-5);
}
TEST(MotionBounds, TwoJointsAcceleration) {
  arm_at_plate(kArmOfTwo, 0, 0.1, 1, {-0.01, -0.02}, {0.01, 0.02}).expect_bound(0.5 * (0.5 * 1e-4 + 0.5 * 9e-4));
}
TEST(MotionBounds, AMimicJointsAcceleration) {
  const std::string robot =
      link("base") + link("upper") + link("tip", 0.5) + joint("one", "revolute", "base", "upper", 0, "0 0 1") +
      joint("two", "revolute", "upper", "tip", 0.5, "0 0 1", "<mimic joint='one' multiplier='2'/>");
  arm_at_plate(robot, 0, 0.1, 1, {-0.01}, {0.01}).expect_bound(0.5 * (0.5 * 1e-4 + 0.5 * 9e-4));
}
TEST(MotionBounds, ASlidingJointOnATurningOne) {
  const std::string robot = link("base") + link("upper") + link("tip", 0) +
                            joint("one", "continuous", "base", "upper", 0, "0 0 1") +
                            joint("out", "prismatic", "upper", "tip", 0, "1 0 0");
  // Its own speed plus the effect of the turn.
  arm_at_plate(robot, 0, 0.2, -0.1, {0, 0.1}, {0, -0.1}).expect_bound(0.1);
  arm_at_plate(robot, 1, 0.1, 0, {-5e-4, 0.05}, {5e-4, -0.05}).expect_bound(2.5e-5);
}

Pose turned_about_z(double angle, const Vec3d& at = {0, 0, 0}) {
  return {at, std::cos(angle / 2), 0, 0, std::sin(angle / 2)};
}

TEST(MotionBounds, ABodysTurnAndShift) {
  for (const int axis : {0, 1}) {
    Approach a;
    add_plate(a.scene, "plate", axis, (axis ? 0 : 1) - 0.1);
    const Vec3d corners[] = {{1, 0, 0}, {1, 0, 1e-6}};
    a.motion.bodies = {a.scene.add_hull("body", corners, {.pose = Pose{}})};
    const double half = axis ? 1e-3 : 1e-2;
    a.motion.poses = {turned_about_z(half), turned_about_z(-half)};
    a.pair = {0, 1};
    a.expect_bound(axis ? 1e-3 : 5e-5);
  }
  Approach shifted;
  add_plate(shifted.scene, "plate", 0, -0.1);
  shifted.motion.bodies = {shifted.scene.add_sphere("body", 0.01, {.pose = Pose{}})};
  shifted.motion.poses = {Pose{{0.05, 0, 0}}, Pose{{-0.05, 0.3, 0}}};
  shifted.pair = {0, 1};
  shifted.expect_bound(0.05);
}

// A rotating base acts as a joint before the others.
TEST(MotionBounds, ATurningBaseUnderAnArm) {
  Approach a = arm_at_plate(kArmOfTwo, 0, 0.1, 1, {-0.02, 0}, {0.02, 0});
  a.motion.bodies = {a.scene.find_body("r")};
  a.motion.poses = {turned_about_z(-0.01), turned_about_z(0.01)};
  a.expect_bound(0.5 * 9e-4);
}

// The distance from the axis of a rotating carrier contributes to the speed.
TEST(MotionBounds, WhatStandsOnACarriedBody) {
  Approach a;
  add_plate(a.scene, "plate", 0, 0.9 - 1e-5);
  const std::uint32_t cart = a.scene.add_sphere("cart", 1e-5, {.pose = Pose{}});
  a.scene.add_sphere("shelf", 1e-5, {.parent = "cart", .pose = Pose{{1, 0, 0}}});
  const std::uint32_t goes = a.scene.add_sphere("goes", 1e-5, {.parent = "shelf", .pose = Pose{}});
  a.motion.bodies = {cart, goes};
  a.motion.poses = {turned_about_z(0.01), Pose{}, turned_about_z(-0.01), Pose{}};
  a.pair = {0, goes};
  a.expect_bound(5e-5);
}

// A common carrier does not count: a joint, a base, or a body that both follow.
TEST(MotionBounds, WhatCarriesBothDoesNotCount) {
  Approach a;
  add_robot(a.scene, kArmOfTwo);
  add_plate(a.scene, "plate", 0, 0.9 - 1e-5, "r/upper");
  a.motion.joints = {0, 1};
  a.motion.positions = {-1, -0.01, 1, 0.01};
  a.motion.bodies = {a.scene.find_body("r")};
  a.motion.poses = {turned_about_z(0.5), turned_about_z(-0.5)};
  a.pair = {a.scene.find_body("plate"), a.scene.find_body("r/tip")};
  a.expect_bound(0.5 * 0.5e-4);
}

// A grasped body moves with its link.
TEST(MotionBounds, AHeldBodyMovesWithItsLink) {
  Approach a = arm_at_plate(kArmOfTwo, 0, 0.1, 1.25, {-0.01, 0}, {0.01, 0});
  a.scene.add_sphere("held", 1e-5, {.parent = "r/tip", .pose = Pose{{0.75, 0, 0}}});
  a.pair.b = a.scene.find_body("held");
  a.expect_bound(0.5 * 1.25e-4);
}

// The uncertainty of a follower grows with its distance from a body whose rotation is uncertain.
TEST(MotionBounds, WhatIsNotKnownGrowsOnTheWay) {
  Approach a;
  a.scene.add_sphere("unsure", 0.1, {.pose = Pose{}, .uncertainty = {.position = 0, .angle = 0.1}});
  add_plate(a.scene, "plate", 1, -1);
  a.motion.bodies = {a.scene.add_sphere("goes", 1e-5, {.parent = "unsure", .pose = Pose{}})};
  a.motion.poses = {Pose{{1, 0, 0}}, Pose{{3, 0, 0}}};
  a.pair = {a.scene.find_body("plate"), a.scene.find_body("goes")};
  a.expect_bound(0.1);
}

// A direction fixed to a rotating reference body: the body's own rotation is subtracted.
TEST(HalfSpans, AlongADirection) {
  engine::Scene scene;
  scene.add_sphere("a", 0.1, {});
  scene.add_sphere("b", 0.1, {});
  const Vec3d corner[] = {{0, 1, 0}, {0, 1, 1e-9}};
  scene.add_hull("far", corner, {});
  const PoseMatrix at_a{rotation_of(Pose{}), {0, 0, 0}, Pose{}}, at_b{rotation_of(Pose{}), {2, 0, 0}, Pose{{2, 0, 0}}};
  const auto gaps = [&](const Twist& of_a, const Twist& of_b, std::uint32_t b, double half, double bend) {
    return gaps_along({1, 0, 0}, {scene.bodies()[0], at_a, of_a}, {scene.bodies()[b], at_b, of_b}, half, bend);
  };
  const HalfSpans still = gaps({}, {}, 1, 0.5, 0);
  EXPECT_NEAR(still.before, 1.8, kOwnRounding);
  EXPECT_NEAR(still.after, 1.8, kOwnRounding);
  EXPECT_LT(still.after, 1.8);
  const HalfSpans nearer = gaps({{0, 0, 0}, {0.5, 0, 0}}, {{0, 0, 0}, {-1, 7, 0}}, 1, 0.25, 0.125);
  EXPECT_NEAR(nearer.after, 1.8 - 0.25 * 1.5 - 0.125, kOwnRounding);
  EXPECT_NEAR(nearer.before, 1.8, kOwnRounding);  // the distance was larger before, apart from the bend
  // A corner 1 m from the origin of a body that rotates towards a: only n x turn counts.
  const HalfSpans turning = gaps({}, {{0, 0, 1}, {0, 0, 0}}, 2, 0.25, 0);
  EXPECT_NEAR(turning.after, 1.9 - 0.25, kOwnRounding);
  EXPECT_NEAR(turning.before, 1.9, kOwnRounding);
}

}  // namespace
}  // namespace clearance::test
