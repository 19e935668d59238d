// On which side of a plane a point lies: the sign of a determinant, certain.
#pragma once

#include "engine/base/vec.h"

namespace clearance {

/// Magnitudes of coordinates that orientation() is exact for. Then every coordinate is a multiple of 2^-252, and so are
/// all differences; no product of three of them underflows (multiples of 2^-756) or overflows.
inline constexpr double kMinOrientationCoordinate = 1e-60;
inline constexpr double kMaxOrientationCoordinate = 1e60;

/// Whether each coordinate is 0 or of a magnitude that orientation() is exact for.
bool orientation_applies(const Vec3d& v);

/// The sign of det[b - a, c - a, p - a] as float64 knows it, or kUnsure; J. R. Shewchuk, "Adaptive precision
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
  // Each product is 0, and so exactly: no difference of two numbers is rounded to 0, and no product underflows.
  return permanent == 0 ? 0 : kUnsure;
}

/// The sign of det[b - a, c - a, p - a]: 1 if p lies on the side of the plane a, b, c from which they are seen to turn
/// counterclockwise, -1 on the other, 0 on the plane. Exact if orientation_applies() to all four.
///
/// Three steps: float64 as above; double-double; and expansions, the same paper's sect. 2.
int orientation(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p);

}  // namespace clearance
