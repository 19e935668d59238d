// Motions of balls on robots and bodies, to 60 digits: the judge. It shares nothing with what it judges but the numbers
// that go in.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "motion_test.h"
#include "tests/robot/exact_robot.h"

namespace clearance::test {

/// The pose at a time of a body that goes straight from one pose to another and turns at constant speed, the shorter
/// way: slerp, by its definition.
inline RealFrame real_between(const Pose& from, const Pose& to, const Real& t) {
  const Real a[4] = {from.qw, from.qx, from.qy, from.qz};
  Real b[4] = {to.qw, to.qx, to.qy, to.qz};
  Real aa = 0, bb = 0, ab = 0;
  for (int k = 0; k < 4; ++k) aa += a[k] * a[k], bb += b[k] * b[k], ab += a[k] * b[k];
  const Real sign = ab < 0 ? -1 : 1, cosine = abs(ab) / sqrt(aa * bb);
  const Real angle = cosine >= 1 ? Real(0) : acos(cosine), sine = sin(angle);
  const Real first = sine == 0 ? 1 - t : sin((1 - t) * angle) / sine, second = sine == 0 ? t : sin(t * angle) / sine;
  Real q[4], n = 0;
  for (int k = 0; k < 4; ++k) q[k] = first * a[k] / sqrt(aa) + second * sign * b[k] / sqrt(bb), n += q[k] * q[k];
  const Real w = q[0], x = q[1], y = q[2], z = q[3];
  RealFrame X;
  const Real R[3][3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                        {2 * (x * y + w * z), w * w + y * y - x * x - z * z, 2 * (y * z - w * x)},
                        {2 * (x * z - w * y), 2 * (y * z + w * x), w * w + z * z - x * x - y * y}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) X.R[i][j] = R[i][j] / n;
  const Vec3d &p = from.translation, &r = to.translation;
  for (int i = 0; i < 3; ++i) X.t.x[i] = Real(p[i]) + t * (Real(r[i]) - Real(p[i]));
  return X;
}

/// A scene of balls: one robot, and bodies beside and on it.
struct ExactBalls {
  struct Ball {
    Vec3d centre;
    double radius;
  };
  const Scene* scene = nullptr;
  std::map<std::uint32_t, Ball> balls;        ///< by body
  std::map<std::uint32_t, Pose> poses;        ///< of bodies that nothing moves, X_wb or X_pb
  std::map<std::uint32_t, std::uint32_t> on;  ///< what such a one follows

  /// Centres of all balls at a time.
  std::map<std::uint32_t, RealVec> at(const Motions& motions, std::uint32_t motion, const Real& t) const {
    std::map<std::uint32_t, RealFrame> frames;
    for (std::size_t i = 0; i < motions.bodies.size(); ++i) {
      const Pose* const from = motions.poses.data() + 2 * motion * motions.bodies.size() + i;
      frames[motions.bodies[i]] = real_between(from[0], from[motions.bodies.size()], t);
    }
    const SceneRobot& robot = *scene->robots()[0];
    if (!frames.count(robot.base)) frames[robot.base] = real_frame(poses.at(robot.base));
    std::vector<Real> q(robot.model.columns.size(), 0);
    const std::size_t joints = motions.joints.size();
    const double* const start = motions.positions.data() + 2 * motion * joints;
    for (std::size_t j = 0; j < joints; ++j)
      q[scene->joints()[motions.joints[j]].column] = Real(start[j]) + t * (Real(start[joints + j]) - Real(start[j]));
    const std::vector<Pose> roots(robot.kinematics.roots().size());
    const auto links = real_links(robot.model, q.data(), robot.kinematics.roots(), roots);
    for (std::size_t l = 0; l < links.size(); ++l) frames[robot.bodies[l]] = frames[robot.base] * links[l];
    std::map<std::uint32_t, RealVec> centres;
    for (const auto& [body, ball] : balls) {
      if (!frames.count(body))
        frames[body] =
            on.count(body) ? frames.at(on.at(body)) * real_frame(poses.at(body)) : real_frame(poses.at(body));
      centres[body] = (frames[body] * real_shift(ball.centre.x, ball.centre.y, ball.centre.z)).t;
    }
    return centres;
  }
  Real distance(const std::map<std::uint32_t, RealVec>& centres, BodyPair pair) const {
    Real sum = 0;
    const RealVec &a = centres.at(pair.a), &b = centres.at(pair.b);
    for (int i = 0; i < 3; ++i) sum += (a.x[i] - b.x[i]) * (a.x[i] - b.x[i]);
    return sqrt(sum) - balls.at(pair.a).radius - balls.at(pair.b).radius;
  }
};

}  // namespace clearance::test
