// Derivative of a pair's distance by joint positions, from its witness points and the axes of the joints. For host and
// device.
#pragma once

#include <cstdint>

#include "engine/narrow/answer.h"

namespace clearance {

/// A joint that a query moves, or one that mimics it.
struct JointMover {
  std::uint32_t slides;         ///< number of axes along which it slides, 0 to 2
  bool turns;                   ///< whether it turns about an axis
  std::uint32_t at[3];          ///< by axis: index in a row of the query's joints, or kNone
  std::uint32_t link, carrier;  ///< the link that it places and the body below it, as PoseOf takes them
  std::uint32_t above;          ///< the next mover on the way to the root, or kNone
  std::uint32_t depth;          ///< number of movers above
  double scale;                 ///< factor of a mimic joint, otherwise 1
  Vec3d along[2];               ///< slides along these, in the axes of `carrier`
  Vec3d axis;                   ///< turns about this, in the axes of its link
};

namespace detail {

// Adds the speed of a point of a body along `normal`, per joint.
// \param point world axes, from the body's origin
template <class PoseOf>
CLEARANCE_HD inline void add_mover(const JointMover& mover, const PoseOf& pose_of, const Vec3d& origin,
                                   const Vec3d& point, const Vec3d& normal, double* out) {
  if (mover.slides > 0) {
    const Mat3d R = pose_of(mover.carrier).R_wb;
    for (std::uint32_t k = 0; k < mover.slides; ++k)
      if (mover.at[k] != kNone) out[mover.at[k]] += mover.scale * dot(normal, R * mover.along[k]);
  }
  const std::uint32_t at = mover.turns ? mover.at[mover.slides] : kNone;
  if (at == kNone) return;
  const auto link = pose_of(mover.link);  // its origin is on the axis
  const Vec3d arm = (origin - link.t_w) + point;
  out[at] += mover.scale * dot(normal, cross(link.R_wb * mover.axis, arm));
}

}  // namespace detail

/// Writes a row of the column gradient_joints, in metres per radian or metre. It is 0 for a joint that moves neither
/// body, or both alike, and for overlapping bodies without depth; NaN without witness points.
/// \param a, b the nearest mover that carries each body, or kNone
/// \param origin_a, origin_b of the bodies, world frame
/// \param pose_of returns R_wb and t_w of a body
/// \param out (joints,)
template <class PoseOf>
CLEARANCE_HD inline void write_joint_gradient(const JointMover* movers, std::uint32_t a, std::uint32_t b,
                                              const PairAnswer& answer, const Vec3d& origin_a, const Vec3d& origin_b,
                                              const PoseOf& pose_of, std::uint32_t joints, double* out) {
  const bool is_known = answer.point_a.x == answer.point_a.x && answer.normal.x == answer.normal.x;
  for (std::uint32_t j = 0; j < joints; ++j) out[j] = is_known ? 0.0 : __builtin_nan("");
  if (!is_known || (answer.status == Status::kOverlap && answer.distance == 0)) return;
  // The distance is n . (p_b - p_a), and each point moves with its body. Movers that carry both bodies change nothing.
  while (a != b) {
    const bool next_is_a = b == kNone || (a != kNone && movers[a].depth >= movers[b].depth);
    if (next_is_a) {
      detail::add_mover(movers[a], pose_of, origin_a, answer.point_a, -answer.normal, out);
      a = movers[a].above;
    } else {
      detail::add_mover(movers[b], pose_of, origin_b, answer.point_b, answer.normal, out);
      b = movers[b].above;
    }
  }
}

}  // namespace clearance
