#include "tests/engine/motion/exact_motion.h"

#include <algorithm>
#include <cassert>

namespace clearance::test {

RealFrame real_between(const Pose& from, const Pose& to, const Real& t) {
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

ExactScene::Moment ExactScene::at(const Motions& motions, std::uint32_t motion, const Real& t) const {
  std::map<std::uint32_t, RealFrame> frames;
  const std::size_t bodies = motions.bodies.size();
  std::map<std::uint32_t, Real> growth;
  for (std::size_t i = 0; i < bodies; ++i) {
    const Pose* const from = motions.poses.data() + motions.points * motion * bodies + i;
    RealFrame& X = frames[motions.bodies[i]] = real_between(from[0], from[motions.points == 2 ? bodies : 0], t);
    const Vec3d& start = from->translation;
    for (int k = 0; k < 3; ++k) X.t.x[k] = real_curve(&start.x + k, motions.points, 7 * bodies, t);
    if (!motions.growths.empty())
      growth[motions.bodies[i]] =
          real_curve(motions.growths.data() + motions.points * motion * bodies + i, motions.points, bodies, t);
  }
  const SceneRobot& robot = *scene->robots()[0];
  if (!frames.count(robot.base)) frames[robot.base] = real_frame(poses.at(robot.base));
  std::vector<Real> q(robot.model.columns.size(), 0);
  const std::size_t joints = motions.joints.size();
  const double* const start = motions.positions.data() + motions.points * motion * joints;
  for (std::size_t j = 0; j < joints; ++j)
    q[scene->joints()[motions.joints[j]].column] = real_curve(start + j, motions.points, joints, t);
  const std::vector<Pose> roots(robot.kinematics.roots().size());
  const auto links = real_links(robot.model, q.data(), robot.kinematics.roots(), roots, origins);
  for (std::size_t l = 0; l < links.size(); ++l) frames[robot.bodies[l]] = frames[robot.base] * links[l];
  Moment moment;
  for (const auto& [body, shape] : shapes) {
    if (!frames.count(body))
      frames[body] = on.count(body) ? frames.at(on.at(body)) * real_frame(poses.at(body)) : real_frame(poses.at(body));
    const Vec3d& c = shape.centre;
    moment[body] = {frames[body], (frames[body] * real_shift(c.x, c.y, c.z)).t, growth[body]};
  }
  return moment;
}

bool ExactScene::answers(BodyPair pair) const {
  const Shape &a = shapes.at(pair.a), &b = shapes.at(pair.b);
  if (a.is_box) return !b.is_box && !b.is_unsure();
  return b.is_box ? !a.is_unsure() : !(a.is_unsure() && b.is_unsure());
}

namespace {

// A ball's centre may be anywhere on a cap around its nominal place: rotated by up to `angle` about `origin`.
Real least_from_cap(const RealVec& from, const RealVec& origin, const RealVec& centre, double angle) {
  const RealVec v = centre - origin, w = from - origin;
  const Real vv = real_length(v), ww = real_length(w);
  if (vv == 0 || ww == 0) return real_length(from - centre);
  const Real cosine = std::clamp<Real>(real_dot(v, w) / (vv * ww), -1, 1), between = acos(cosine);
  if (between <= angle) return abs(vv - ww);
  const Real rest = between - angle;
  return sqrt(std::max<Real>(vv * vv + ww * ww - 2 * vv * ww * cos(rest), 0));
}

}  // namespace

Real ExactScene::distance(const Moment& moment, BodyPair pair) const {
  assert(answers(pair));
  if (shapes.at(pair.a).is_box || shapes.at(pair.b).is_unsure()) std::swap(pair.a, pair.b);
  const Shape &ball = shapes.at(pair.a), &other = shapes.at(pair.b);
  const Placed &p = moment.at(pair.a), &q = moment.at(pair.b);
  const Real grown = p.growth + q.growth;
  if (!other.is_box) {
    const Real apart =
        ball.angle > 0 ? least_from_cap(q.centre, p.X.t, p.centre, ball.angle) : real_length(p.centre - q.centre);
    return apart - ball.radius - ball.position - other.radius - grown;
  }
  const RealVec w = p.centre - q.X.t;
  Real outside = 0;
  for (int i = 0; i < 3; ++i) {
    const Real along = q.X.R[0][i] * w.x[0] + q.X.R[1][i] * w.x[1] + q.X.R[2][i] * w.x[2];
    const Real over = std::max<Real>(abs(along) - Real(other.half[i]), 0);
    outside += over * over;
  }
  return sqrt(outside) - ball.radius - grown;
}

double ExactScene::rough_distance(const Moment& moment, BodyPair pair) const {
  const Shape &a = shapes.at(pair.a), &b = shapes.at(pair.b);
  if (a.is_unsure() || b.is_unsure()) return static_cast<double>(distance(moment, pair));
  const Placed &p = moment.at(a.is_box ? pair.b : pair.a), &q = moment.at(a.is_box ? pair.a : pair.b);
  double w[3], sum = 0;
  for (int i = 0; i < 3; ++i) w[i] = static_cast<double>(p.centre.x[i] - q.centre.x[i]);
  for (int i = 0; i < 3; ++i) {
    double along = w[i];
    if (a.is_box || b.is_box) {
      along = 0;
      for (int k = 0; k < 3; ++k) along += static_cast<double>(q.X.R[k][i]) * w[k];
      along = std::max(std::abs(along) - (a.is_box ? a : b).half[i], 0.0);
    }
    sum += along * along;
  }
  return std::sqrt(sum) - a.radius - b.radius - static_cast<double>(p.growth + q.growth);
}

}  // namespace clearance::test
