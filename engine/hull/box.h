// Boxes that surely hold what stands in them: of placed pieces, put together, and how far apart they are. For host and
// device.
#pragma once

#include <cmath>
#include <limits>

#include "engine/base/arithmetic.h"
#include "engine/base/slack.h"
#include "engine/base/vec.h"
#include "engine/hull/piece.h"
#include "engine/hull/primitive.h"

namespace clearance {

/// A box aligned with the world's axes, grown outward by its own rounding.
struct Aabb {
  Vec3d low, high;
};
/// A box that surely holds a placed piece, radius included: around the piece's own box as it stands turned and around
/// the ball about its centre. \param t_w the body's origin in the world. \param centre, half, spread, rho, radius the
/// piece's.
CLEARANCE_HD inline Aabb certify_box(const Vec3d& centre, const Vec3d& half, double spread, double rho, double radius,
                                     const Mat3d& R_wb, const Vec3d& t_w) {
  using std::abs;
  const Vec3d c = R_wb * centre;
  Aabb box;
  for (int k = 0; k < 3; ++k) {
    const Vec3d& row = R_wb.row[k];
    const double turned = abs(row.x) * half.x + abs(row.y) * half.y + abs(row.z) * half.z;
    const double extent = (turned < spread ? turned : spread) + radius;
    // 16 units cover the rotation, the products and the sums (docs/bounds.md, boxes).
    const double rounding =
        16 * 0x1p-53 * (rho + norm(half) + radius + abs(t_w[k])) + Arithmetic<double>::kUnderflowLength;
    box.low[k] = (c[k] + t_w[k]) - extent - rounding;
    box.high[k] = (c[k] + t_w[k]) + extent + rounding;
  }
  return box;
}
/// Metres: farther out than any body can be, and small enough to be squared.
inline constexpr double kBeyondAll = 1e100;

/// A box that surely holds a placed half-space, z <= radius in the body's frame, as far out as bodies may be. Only
/// where its plane lies along two of the world's axes does it leave room beside it. An entry of a rotation that is
/// computed as 0 is 0 (docs/bounds.md, boxes).
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
inline Aabb certify_box(const Piece& piece, const Mat3d& R_wb, const Vec3d& t_w) {
  if (is_half_space(piece)) return certify_half_space_box(piece.radius, R_wb, t_w);
  return certify_box(piece.centre, piece.half, piece.spread, piece.rho, piece.radius, R_wb, t_w);
}
/// A lower bound on the distance of whatever two boxes hold; 0 if they touch.
CLEARANCE_HD inline double certify_box_gap(const Aabb& a, const Aabb& b) {
  Vec3d gap;
  for (int k = 0; k < 3; ++k) {
    const double ahead = b.low[k] - a.high[k], behind = a.low[k] - b.high[k];
    gap[k] = ahead > 0 ? ahead : 0;
    if (behind > gap[k]) gap[k] = behind;
  }
  return norm(gap) * (1 - 8 * 0x1p-53);
}

/// Holds nothing (low > high), and adds nothing to what it is joined with.
inline constexpr Aabb kEmptyBox{{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                                 std::numeric_limits<double>::infinity()},
                                {-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
                                 -std::numeric_limits<double>::infinity()}};

/// A box that holds whatever is no farther than `by` metres from something in this one.
CLEARANCE_HD inline Aabb grown(Aabb box, double by) {
  for (int k = 0; k < 3; ++k) {
    box.low[k] = difference_below(box.low[k], by);
    box.high[k] = sum_above(box.high[k], by);
  }
  return box;
}

/// The least box that holds both.
CLEARANCE_HD inline Aabb joined(const Aabb& a, const Aabb& b) {
  Aabb box;
  for (int k = 0; k < 3; ++k) {
    box.low[k] = b.low[k] < a.low[k] ? b.low[k] : a.low[k];
    box.high[k] = a.high[k] < b.high[k] ? b.high[k] : a.high[k];
  }
  return box;
}

}  // namespace clearance
