// Lower bound on the distance of two convex parts that skips most searches among bodies of several parts.
#pragma once

#include <algorithm>
#include <limits>

#include "engine/hull/box.h"
#include "engine/hull/convex_part.h"
#include "engine/pose/placed.h"

namespace clearance {

/// Lower bound on the signed distance of two placed parts, radii included, from boxes and balls around them. -inf for
/// cores in closed form whose boxes touch.
inline double part_gap(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b) {
  constexpr double kRounding = 0x1p-44;  // of the sums below, relative to the lengths in them
  const double boxes =
      certify_box_gap(certify_box(a, pose_a.R_wb, pose_a.t_w), certify_box(b, pose_b.R_wb, pose_b.t_w));
  const double apart = boxes > 0 ? boxes : -std::numeric_limits<double>::infinity();  // touching boxes prove nothing
  if (a.primitive || b.primitive) return apart;
  const Vec3d between = pose_b.R_wb * b.centre + pose_b.t_w - (pose_a.R_wb * a.centre + pose_a.t_w);
  const double error = kRounding * (norm(pose_a.t_w) + norm(pose_b.t_w) + a.rho + b.rho + a.radius + b.radius);
  return std::max(apart, norm(between) - a.spread - b.spread - a.radius - b.radius - error);
}

}  // namespace clearance
