// Second derivatives of distances from cones, cylinders and ellipsoids.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "engine/hull/primitive.h"
#include "tests/engine/evaluate_query.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {
namespace {

using test::Answer;
using test::evaluate;
using test::Real;
using test::RealFrame;

Real root_of_squares(const Real& a, const Real& b) {
  return sqrt(a * a + b * b);
}

Real to_segment(const Real& x, const Real& y, const Real& ax, const Real& ay, const Real& bx, const Real& by) {
  const Real ex = bx - ax, ey = by - ay;
  Real t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey);
  t = t < 0 ? Real(0) : t > 1 ? Real(1) : t;
  return root_of_squares(x - ax - t * ex, y - ay - t * ey);
}

// Distance of a point outside from a core of these sizes, in its axes.
Real distance_from(Primitive::Kind kind, const Vec3d& size, const Real (&p)[3]) {
  const Real rho = root_of_squares(p[0], p[1]), R = size.x, h = size.z;
  if (kind == Primitive::Kind::kCylinder) {
    const Real out = rho > R ? rho - R : Real(0), up = abs(p[2]) > h ? abs(p[2]) - h : Real(0);
    return root_of_squares(out, up);
  }
  if (kind == Primitive::Kind::kCone)
    return std::min(to_segment(rho, p[2], 0, -h, R, -h), to_segment(rho, p[2], R, -h, 0, h));
  const double a[3] = {size.x, size.y, size.z};
  Real t = 0;  // Newton on a convex decreasing function, from below its root
  for (int i = 0; i < 200; ++i) {
    Real f = -1, slope = 0;
    for (int k = 0; k < 3; ++k) {
      const Real q = a[k] * p[k] / (t + Real(a[k]) * a[k]);
      f += q * q;
      slope -= 2 * q * q / (t + Real(a[k]) * a[k]);
    }
    const Real step = f / slope;
    t -= step;
    if (abs(step) < Real(1e-55)) break;
  }
  Real sum = 0;
  for (int k = 0; k < 3; ++k) {
    const Real gap = p[k] - Real(a[k]) * a[k] * p[k] / (t + Real(a[k]) * a[k]);
    sum += gap * gap;
  }
  return sqrt(sum);
}

// A ball on three sliding joints.
const char* const kBall =
    "<robot name='s'><link name='l0'/><link name='l1'/><link name='l2'/><link name='l3'><collision><geometry>"
    "<sphere radius='0.1'/></geometry></collision></link>"
    "<joint name='x' type='prismatic'><parent link='l0'/><child link='l1'/><axis xyz='1 0 0'/>"
    "<limit lower='-9' upper='9'/></joint>"
    "<joint name='y' type='prismatic'><parent link='l1'/><child link='l2'/><axis xyz='0 1 0'/>"
    "<limit lower='-9' upper='9'/></joint>"
    "<joint name='z' type='prismatic'><parent link='l2'/><child link='l3'/><axis xyz='0 0 1'/>"
    "<limit lower='-9' upper='9'/></joint></robot>";

TEST(SecondOrderOfRoundCores, OfABallIsTheSecondDerivativeOfThe60DigitDistance) {
  test::RobotRandom random(48);
  const TemporaryFolder folder;
  const std::string urdf = folder.write("s.urdf", kBall);
  double worst = 0;
  std::map<Primitive::Kind, int> compared;
  for (int i = 0; i < 60; ++i) {
    const Primitive::Kind kind = i % 3 == 0   ? Primitive::Kind::kCylinder
                                 : i % 3 == 1 ? Primitive::Kind::kCone
                                              : Primitive::Kind::kEllipsoid;
    const Pose pose = random.pose(0.5, 1);
    const Vec3d size{0.5, kind == Primitive::Kind::kEllipsoid ? 0.3 : 0.5, 0.75};
    engine::Scene scene;
    if (kind == Primitive::Kind::kCylinder) scene.add_cylinder("core", size.x, 2 * size.z, {.pose = pose});
    if (kind == Primitive::Kind::kCone) scene.add_cone("core", size.x, 2 * size.z, {.pose = pose});
    if (kind == Primitive::Kind::kEllipsoid) scene.add_ellipsoid("core", size, {.pose = pose});
    engine::RobotOptions options;
    options.urdf = urdf;
    options.home.emplace();
    scene.add_robot("s", options);
    const std::uint32_t joints[] = {0, 1, 2};
    const BodyPair pair{0, scene.find_body("s/l3")};
    const engine::Engine engine(std::move(scene), test::kWithoutCovers);
    constexpr std::uint32_t kStates = 16;
    std::vector<double> rows;
    for (std::uint32_t k = 0; k < 3 * kStates; ++k) rows.push_back(random.uniform(-1.5, 1.5));
    QueryView query = test::query_of_pair(pair);
    query.joints = joints;
    query.positions = rows;
    query.configuration_count = kStates;
    query.fields = kDefaultFields | kFieldHessianJoints | kFieldSmoothRadius;
    const Answer answer = evaluate(engine, query);
    const RealFrame X = test::real_frame(pose);
    const Real step = Real(1) / Real(1e15);
    const auto distance = [&](std::uint32_t k, int i1, int s1, int i2, int s2) {
      Real x[3], p[3];
      for (int c = 0; c < 3; ++c) x[c] = Real(rows[3 * k + c]) - X.t.x[c];
      x[i1] += s1 * step;
      x[i2] += s2 * step;
      for (int c = 0; c < 3; ++c) p[c] = X.R[0][c] * x[0] + X.R[1][c] * x[1] + X.R[2][c] * x[2];
      return distance_from(kind, size, p);
    };
    for (std::uint32_t k = 0; k < kStates; ++k) {
      if (!(answer.view.smooth_radius[k] > 1e-5) || !(answer.view.lower[k] > -0.05)) continue;
      ASSERT_NEAR(static_cast<double>(distance(k, 0, 0, 0, 0)) - 0.1, answer.view.upper[k], 2e-6);
      ++compared[kind];
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) {
          const Real exact = (distance(k, r, 1, c, 1) - distance(k, r, 1, c, -1) - distance(k, r, -1, c, 1) +
                              distance(k, r, -1, c, -1)) /
                             (4 * step * step);
          const double error = std::abs(answer.view.hessian_joints[9 * k + 3 * r + c] - static_cast<double>(exact));
          worst = std::max(worst, error / std::max(1.0, std::abs(static_cast<double>(exact))));
        }
    }
  }
  RecordProperty("worst", std::to_string(worst));
  EXPECT_LT(worst, 1e-9);
  for (const auto kind : {Primitive::Kind::kCylinder, Primitive::Kind::kCone, Primitive::Kind::kEllipsoid})
    EXPECT_GT(compared[kind], 150);
}

// Twists of both bodies, against differences of certified distances, whose rounding leaves about 1e-6.
TEST(SecondOrderOfRoundCores, OfTurningBodiesIsTheDifferenceOfDistances) {
  test::RobotRandom random(49);
  int compared = 0, round = 0;
  for (int i = 0; i < 40; ++i) {
    engine::Scene scene;
    scene.add_cylinder("cylinder", 0.2, 0.7, {.pose = Pose{}});
    scene.add_cone("cone", 0.3, 0.6, {.pose = Pose{}});
    scene.add_ellipsoid("ellipsoid", {0.2, 0.3, 0.45}, {.pose = Pose{}});
    scene.add_box("box", {0.3, 0.4, 0.5}, {.pose = Pose{}});
    scene.add_capsule("capsule", 0.1, 0.5, {.pose = Pose{}});
    scene.add_half_space("floor", {.pose = Pose{{0, 0, -1.5}}});
    const std::uint32_t bodies[] = {0, 1, 2, 3, 4};
    const engine::Engine engine(std::move(scene), test::kWithoutCovers);
    constexpr double kStep = 1e-3;
    std::vector<Pose> poses;
    std::vector<double> twists;
    std::vector<Pose> first;
    for (int b = 0; b < 5; ++b) {
      first.push_back(random.pose(1.2, 1));
      for (int c = 0; c < 6; ++c) twists.push_back(random.uniform(-1, 1));
    }
    for (int s = -2; s <= 2; ++s)
      for (int b = 0; b < 5; ++b) {
        const double* const t = twists.data() + 6 * b;
        const double rate = std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]), half = rate * s * kStep / 2,
                     f = std::sin(half) / rate;
        Pose turn;
        turn.qw = std::cos(half), turn.qx = f * t[0], turn.qy = f * t[1], turn.qz = f * t[2];
        const Pose& p = first[static_cast<std::size_t>(b)];
        Pose moved;
        moved.translation = p.translation + Vec3d{t[3], t[4], t[5]} * (s * kStep);
        moved.qw = turn.qw * p.qw - turn.qx * p.qx - turn.qy * p.qy - turn.qz * p.qz;
        moved.qx = turn.qw * p.qx + turn.qx * p.qw + turn.qy * p.qz - turn.qz * p.qy;
        moved.qy = turn.qw * p.qy - turn.qx * p.qz + turn.qy * p.qw + turn.qz * p.qx;
        moved.qz = turn.qw * p.qz + turn.qx * p.qy - turn.qy * p.qx + turn.qz * p.qw;
        poses.push_back(moved);
      }
    std::vector<double> all_twists;
    for (int s = 0; s < 5; ++s) all_twists.insert(all_twists.end(), twists.begin(), twists.end());
    QueryView query;
    query.bodies = bodies;
    query.configurations = poses;
    query.configuration_count = 5;
    query.twists = all_twists;
    query.rel_tol = 1e-13;
    query.fields = kDefaultFields | kFieldRate | kFieldCurvature | kFieldSmoothRadius;
    const std::vector<BodyPair> pairs = engine.pairs(query);
    const Answer answer = evaluate(engine, query);
    const std::size_t P = pairs.size();
    for (std::size_t p = 0; p < P; ++p) {
      const auto d = [&](int s) { return answer.view.distance[static_cast<std::size_t>(s + 2) * P + p]; };
      bool smooth = answer.view.lower[2 * P + p] > 0.05;
      for (std::size_t s = 0; s < 5; ++s) smooth = smooth && answer.view.smooth_radius[s * P + p] > 0.02;
      if (!smooth) continue;
      ++compared;
      round += pairs[p].a < 3 && pairs[p].b < 3;
      const double rate = (d(-2) - 8 * d(-1) + 8 * d(1) - d(2)) / (12 * kStep);
      const double second = (-d(-2) + 16 * d(-1) - 30 * d(0) + 16 * d(1) - d(2)) / (12 * kStep * kStep);
      EXPECT_NEAR(answer.view.rate[2 * P + p], rate, 1e-8) << pairs[p].a << " " << pairs[p].b << " of scene " << i;
      EXPECT_NEAR(answer.view.curvature[2 * P + p], second, 1e-5 * (1 + std::abs(second)))
          << pairs[p].a << " " << pairs[p].b << " of scene " << i;
    }
  }
  EXPECT_GT(compared, 100);
  EXPECT_GT(round, 20) << "two curved cores";
}

}  // namespace
}  // namespace clearance::exact
