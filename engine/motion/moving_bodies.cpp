// The data of one motion, and of a span of a curve.
#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/motion/motion_bounds.h"

namespace clearance {

namespace {

// CurveSpan has bounds for positions up to kMaxPosition.
bool is_usable_on_curve(const Pose& X) {
  const Vec3d& t = X.translation;
  return check(X) != PoseQuality::kBad && std::max({std::abs(t.x), std::abs(t.y), std::abs(t.z)}) <= kMaxPosition;
}

}  // namespace

void MotionBounds::take_joints(std::size_t robot, MovingBodies& moving) const {
  const LinkMotion& motion = plan_.motions[robot];
  const std::size_t joints = plan_.joints.size(), columns = motion.robot().model.columns.size();
  const double* const start = plan_.positions.data() + plan_.query.control_points * moving.motion * joints;
  const double* const end = start + joints;
  std::vector<double>&along = moving.along[robot], &change = moving.change[robot], &rounding = moving.rounding[robot];
  along.assign(columns, 0);
  change.assign(columns, 0);
  moving.bend[robot].assign(columns, 0);
  rounding.assign(columns, 0);
  const PoseSnapshot::Joints& stand = plan_.snapshot->joints;
  std::vector<double> first(columns), last;
  for (std::size_t c = 0; c < columns; ++c)
    if (const std::size_t j = motion.robot().first_joint + c; stand.given[j]) first[c] = stand.position[j];
  last = first;
  for (const LinkMotion::Moving& m : motion.moving()) {
    if (!moving.curves.empty()) {
      const JointCurve& curve = moving.curves[m.at];
      first[m.column] = curve.least();
      last[m.column] = curve.greatest();
      rounding[m.column] = curve.rounding();
      continue;
    }
    const double q0 = start[m.at], q1 = end[m.at];
    first[m.column] = q0;
    last[m.column] = q1;
    const JointChange by = joint_change(q0, q1);
    along[m.column] = by.along;
    change[m.column] = by.change;
    rounding[m.column] = by.rounding;
  }
  const Kinematics& kinematics = motion.robot().kinematics;
  moving.travel[robot] = std::max(kinematics.travel(first), kinematics.travel(last));
}

// Along a curve the control poses have one rotation. An unusable one makes the motion unusable.
void MotionBounds::take_given(MovingBodies& moving) const {
  const std::size_t points = plan_.query.control_points, bodies = plan_.given_bodies;
  const Pose* const start = plan_.configurations.data() + points * moving.motion * bodies;
  moving.given.clear();
  moving.half_turn = false;
  for (std::size_t i = 0; i < bodies; ++i) {
    Pose end = start[i + (points > 2 ? 0 : bodies)];
    for (std::size_t p = 0; points > 2 && p < points; ++p)
      if (!is_usable_on_curve(start[i + p * bodies])) end.qw = std::numeric_limits<double>::quiet_NaN();
    moving.given.emplace_back(start[i], end);
    moving.half_turn |= moving.given.back().is_half_turn();
  }
}

void MotionBounds::take_curves(MovingBodies& moving) const {
  const std::uint32_t points = plan_.query.control_points;
  const std::size_t joints = plan_.joints.size(), bodies = plan_.given_bodies, first = points * moving.motion;
  moving.curves.clear();
  moving.growths.clear();
  moving.growth.clear();
  if (!plan_.growths.empty())
    for (std::size_t i = 0; i < bodies; ++i) {
      const JointCurve& growth = moving.growths.emplace_back(plan_.growths.data() + first * bodies + i, points, bodies);
      const double by = growth.at(1) - growth.begin();
      moving.growth.push_back({{by, by}, std::abs(by) * kMotionSlack, 0});  // if it is linear
    }
  if (points == 2) return;
  for (std::size_t j = 0; j < joints; ++j)
    moving.curves.emplace_back(plan_.positions.data() + first * joints + j, points, joints);
  for (std::size_t i = 0; i < bodies; ++i) {
    const Vec3d& start = plan_.configurations[first * bodies + i].translation;
    for (const double* coordinate : {&start.x, &start.y, &start.z})
      moving.curves.emplace_back(coordinate, points, bodies * (sizeof(Pose) / sizeof(double)));
  }
  moving.curves.insert(moving.curves.end(), moving.growths.begin(), moving.growths.end());
}

void MotionBounds::take(std::uint64_t motion, MovingBodies& moving) const {
  moving.motion = motion;
  take_given(moving);
  take_curves(moving);
  moving.along.resize(plan_.motions.size());
  moving.change.resize(plan_.motions.size());
  moving.bend.resize(plan_.motions.size());
  moving.rounding.resize(plan_.motions.size());
  moving.travel.resize(plan_.motions.size());
  for (std::size_t m = 0; m < plan_.motions.size(); ++m) take_joints(m, moving);
  moving.given_rates.assign(plan_.given_bodies, {});
  moving.chain_ways.clear();
  moving.chain_rests.clear();
  take_rates(moving);
}

void MotionBounds::take_sides(double begin, double time, double end, MovingBodies& moving) const {
  if (moving.curves.empty()) return;
  using Curve = CurveSides::Curve;
  moving.sides.take(moving.curves, begin, time, end);
  moving.chain_ways.clear();
  moving.chain_rests.clear();
  take_parts(moving, [](const Curve& curve) { return JointSpan{0, curve.way, 0}; });
  for (const MotionRates& rates : moving.chains) moving.chain_ways.push_back(rates.speed);
  take_parts(moving, [](const Curve& curve) { return JointSpan{0, curve.rest, 2 * curve.rest}; });
  for (const MotionRates& rates : moving.chains) moving.chain_rests.push_back(0.5 * rates.acceleration);
  take_parts(moving, [](const Curve& curve) { return JointSpan{0, curve.change, 2 * curve.rest}; });
  const Curve* const growths = moving.sides.curves().data() + moving.curves.size() - moving.growths.size();
  for (std::size_t i = 0; i < moving.growths.size(); ++i) std::copy_n(growths[i].chord, 2, moving.growth[i].slope);
}

// Takes the rates of all curves, and those of the chains.
template <class SpanOf>
void MotionBounds::take_parts(MovingBodies& moving, const SpanOf& span_of) const {
  const std::span<const CurveSides::Curve> curves = moving.sides.curves();
  for (std::size_t m = 0; m < plan_.motions.size(); ++m)
    for (const LinkMotion::Moving& joint : plan_.motions[m].moving()) {
      const JointSpan span = span_of(curves[joint.at]);
      moving.change[m][joint.column] = span.change;
      moving.bend[m][joint.column] = span.bend;
    }
  const CurveSides::Curve* by = curves.data() + plan_.joints.size();
  moving.given_rates.assign(plan_.given_bodies, {});
  for (MotionRates& rates : moving.given_rates) {
    const JointSpan x = span_of(by[0]), y = span_of(by[1]), z = span_of(by[2]);
    rates = {std::hypot(x.change, y.change, z.change) * kMotionSlack, std::hypot(x.bend, y.bend, z.bend) * kMotionSlack,
             0};
    by += 3;
  }
  for (GrowthSpan& growth : moving.growth) {
    const JointSpan span = span_of(*by++);
    growth.change = span.change;
    growth.bend = span.bend;
  }
  take_rates(moving);
}

}  // namespace clearance
