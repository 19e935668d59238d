// Exact side of a plane for a point: the sign of a determinant.
#pragma once

#include "engine/base/vec.h"

namespace clearance {

/// Range of the magnitudes of coordinates for which orientation() is exact. Every coordinate, and so every difference,
/// is then a multiple of 2^-252; no product of three of them underflows (multiples of 2^-756) or overflows.
inline constexpr double kMinOrientationCoordinate = 1e-60;
inline constexpr double kMaxOrientationCoordinate = 1e60;

/// Whether each coordinate is 0 or has a magnitude in that range.
bool orientation_applies(const Vec3d& v);

/// Sign of det[b - a, c - a, p - a] if float64 decides it, otherwise kUnsure; J. R. Shewchuk, "Adaptive precision
/// floating-point arithmetic and fast robust geometric predicates" (1997), sect. 4.3. For host and device.
inline constexpr int kUnsure = 2;
CLEARANCE_HD inline int orientation_in_float64(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p,
                                               double& permanent) {
  const auto size = [](double x) { return x < 0 ? -x : x; };
  const Vec3d u = b - a, v = c - a, w = p - a;
  const double xy = u.x * v.y, yx = u.y * v.x, yz = u.y * v.z, zy = u.z * v.y, zx = u.z * v.x, xz = u.x * v.z;
  const double det = w.x * (yz - zy) + w.y * (zx - xz) + w.z * (xy - yx);
  permanent = size(w.x) * (size(yz) + size(zy)) + size(w.y) * (size(zx) + size(xz)) + size(w.z) * (size(xy) + size(yx));
  constexpr double kU = 0x1p-53, kBound = (7 + 56 * kU) * kU;
  if (det > kBound * permanent) return 1;
  if (-det > kBound * permanent) return -1;
  // Every product is 0, and exactly so: no nonzero difference rounds to 0, and no product underflows.
  return permanent == 0 ? 0 : kUnsure;
}

/// Sign of det[b - a, c - a, p - a]: 1 if p lies on the side of the plane from which a, b, c appear counterclockwise,
/// -1 on the other side, 0 on the plane. Exact if orientation_applies() to all four.
///
/// Three steps: float64 as above; double-double; and expansions, the same paper's sect. 2.
int orientation(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p);

}  // namespace clearance
