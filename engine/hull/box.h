// Boxes that are proved to contain placed convex parts, their unions and the gaps between them. For host and device.
#pragma once

#include <cmath>
#include <limits>

#include "engine/base/arithmetic.h"
#include "engine/base/slack.h"
#include "engine/base/vec.h"
#include "engine/hull/convex_part.h"
#include "engine/hull/primitive.h"

namespace clearance {

/// A box aligned with the world's axes, grown outward by its own rounding.
struct Aabb {
  Vec3d low, high;
};
/// A box proved to contain a placed part, radius included: the intersection of the rotated part's own box with the ball
/// about its centre.
/// \param centre,half,spread,rho,radius of the part
/// \param t_w the body's origin in the world
CLEARANCE_HD inline Aabb certify_box(const Vec3d& centre, const Vec3d& half, double spread, double rho, double radius,
                                     const Mat3d& R_wb, const Vec3d& t_w) {
  using std::abs;
  const Vec3d c = R_wb * centre;
  Aabb box;
  for (int k = 0; k < 3; ++k) {
    const Vec3d& row = R_wb.row[k];
    const double turned = abs(row.x) * half.x + abs(row.y) * half.y + abs(row.z) * half.z;
    const double extent = (turned < spread ? turned : spread) + radius;
    // 16 units cover the rotation, the products and the sums (docs/trust/bounds.md, boxes).
    const double rounding =
        16 * 0x1p-53 * (rho + norm(half) + radius + abs(t_w[k])) + Arithmetic<double>::kUnderflowLength;
    box.low[k] = (c[k] + t_w[k]) - extent - rounding;
    box.high[k] = (c[k] + t_w[k]) + extent + rounding;
  }
  return box;
}
/// Metres: farther than any body can be, and small enough to be squared.
inline constexpr double kBeyondAll = 1e100;

/// A box proved to contain a placed half-space, z <= radius in the body's frame, as far out as bodies may be. It leaves
/// free space only if the plane lies along two of the world's axes. An entry of a rotation that is computed as 0 is 0
/// (docs/trust/bounds.md, boxes).
inline Aabb certify_half_space_box(double radius, const Mat3d& R_wb, const Vec3d& t_w) {
  Aabb box{{-kBeyondAll, -kBeyondAll, -kBeyondAll}, {kBeyondAll, kBeyondAll, kBeyondAll}};
  const Vec3d n{R_wb.row[0].z, R_wb.row[1].z, R_wb.row[2].z};
  for (int k = 0; k < 3; ++k) {
    if (n[(k + 1) % 3] != 0 || n[(k + 2) % 3] != 0) continue;
    const double reach = radius + 16 * 0x1p-53 * (radius + std::abs(t_w[k])) + Arithmetic<double>::kUnderflowLength;
    if (n[k] > 0)
      box.high[k] = t_w[k] + reach;
    else
      box.low[k] = t_w[k] - reach;
  }
  return box;
}
inline Aabb certify_box(const ConvexPart& part, const Mat3d& R_wb, const Vec3d& t_w) {
  if (is_half_space(part)) return certify_half_space_box(part.radius, R_wb, t_w);
  return certify_box(part.centre, part.half, part.spread, part.rho, part.radius, R_wb, t_w);
}
/// Lower bound on the distance of the contents of two boxes; 0 if they touch.
CLEARANCE_HD inline double certify_box_gap(const Aabb& a, const Aabb& b) {
  Vec3d gap;
  for (int k = 0; k < 3; ++k) {
    const double ahead = b.low[k] - a.high[k], behind = a.low[k] - b.high[k];
    gap[k] = ahead > 0 ? ahead : 0;
    if (behind > gap[k]) gap[k] = behind;
  }
  return norm(gap) * (1 - 8 * 0x1p-53);
}

/// The empty box (low > high), neutral in joined().
inline constexpr Aabb kEmptyBox{{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                                 std::numeric_limits<double>::infinity()},
                                {-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
                                 -std::numeric_limits<double>::infinity()}};

/// A box that contains all points within `by` metres of this one's contents.
CLEARANCE_HD inline Aabb grown(Aabb box, double by) {
  for (int k = 0; k < 3; ++k) {
    box.low[k] = difference_below(box.low[k], by);
    box.high[k] = sum_above(box.high[k], by);
  }
  return box;
}

/// The least box that contains both.
CLEARANCE_HD inline Aabb joined(const Aabb& a, const Aabb& b) {
  Aabb box;
  for (int k = 0; k < 3; ++k) {
    box.low[k] = b.low[k] < a.low[k] ? b.low[k] : a.low[k];
    box.high[k] = a.high[k] < b.high[k] ? b.high[k] : a.high[k];
  }
  return box;
}

}  // namespace clearance
