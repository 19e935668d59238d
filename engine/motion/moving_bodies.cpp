// The data of one motion, and of a span of a curve.
#include <algorithm>

#include "engine/motion/motion_bounds.h"

namespace clearance {

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

void MotionBounds::take(std::uint64_t motion, MovingBodies& moving) const {
  moving.motion = motion;
  moving.given.clear();
  moving.half_turn = false;
  const Pose* const start = plan_.configurations.data() + 2 * motion * plan_.given_bodies;
  for (std::size_t i = 0; i < plan_.given_bodies; ++i) {
    moving.given.emplace_back(start[i], start[plan_.given_bodies + i]);
    moving.half_turn |= moving.given.back().is_half_turn();
  }
  moving.curves.clear();
  if (const std::uint32_t points = plan_.query.control_points; points > 2)
    for (std::size_t j = 0, joints = plan_.joints.size(); j < joints; ++j)
      moving.curves.emplace_back(plan_.positions.data() + points * motion * joints + j, points, joints);
  moving.along.resize(plan_.motions.size());
  moving.change.resize(plan_.motions.size());
  moving.bend.resize(plan_.motions.size());
  moving.rounding.resize(plan_.motions.size());
  moving.travel.resize(plan_.motions.size());
  for (std::size_t m = 0; m < plan_.motions.size(); ++m) take_joints(m, moving);
  if (moving.curves.empty())
    take_rates(moving);
  else
    take_span(0, 1, moving);
}

void MotionBounds::take_span(double begin, double end, MovingBodies& moving) const {
  if (moving.curves.empty()) return;
  moving.span.take(moving.curves, begin, end);
  for (std::size_t m = 0; m < plan_.motions.size(); ++m)
    for (const LinkMotion::Moving& joint : plan_.motions[m].moving()) {
      const JointSpan& span = moving.span.joints()[joint.at];
      moving.along[m][joint.column] = span.slope;
      moving.change[m][joint.column] = span.change;
      moving.bend[m][joint.column] = span.bend;
    }
  take_rates(moving);
}

// The error of a velocity counts as an acceleration.
void MotionBounds::take_derivatives(double begin, double end, MovingBodies& moving) const {
  if (moving.curves.empty()) return;
  const double middle = 0.5 * begin + 0.5 * end, half = std::max(end - middle, middle - begin);
  for (std::size_t m = 0; m < plan_.motions.size(); ++m)
    for (const LinkMotion::Moving& joint : plan_.motions[m].moving()) {
      const JointDerivatives span = moving.curves[joint.at].derivatives(begin, end);
      moving.along[m][joint.column] = span.slope;
      moving.change[m][joint.column] = span.change;
      moving.bend[m][joint.column] = (span.bend + 2 * span.error / half) * (1 + 0x1p-30);
    }
  take_rates(moving);
}

}  // namespace clearance
