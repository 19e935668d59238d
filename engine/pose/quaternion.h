// Quaternions over any scalar, for kinematics in single configurations, SIMD lanes and GPU threads.
#pragma once

#include "engine/base/vec.h"

namespace clearance {

template <class T>
struct Quaternion {
  T w, x, y, z;
};

/// The rotation b followed by a in fixed axes. The error of each component is at most 3 roundings of the sum of its
/// terms' magnitudes.
template <class T>
CLEARANCE_INLINE Quaternion<T> product(const Quaternion<T>& a, const Quaternion<T>& b) {
  return {(a.w * b.w - a.x * b.x) - (a.y * b.y + a.z * b.z), (a.w * b.x + a.x * b.w) + (a.y * b.z - a.z * b.y),
          (a.w * b.y + a.y * b.w) + (a.z * b.x - a.x * b.z), (a.w * b.z + a.z * b.w) + (a.x * b.y - a.y * b.x)};
}

/// M(q) v. For a q of length 1 + d, rotates v and scales it by (1 + d)^2.
template <class T>
CLEARANCE_INLINE Vec3<T> turned(const Quaternion<T>& q, const Vec3<T>& v) {
  const T two(2.0);
  const T ww = q.w * q.w, xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
  const T wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z, xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
  return {((ww + xx) - (yy + zz)) * v.x + two * (xy - wz) * v.y + two * (xz + wy) * v.z,
          two * (xy + wz) * v.x + ((ww + yy) - (xx + zz)) * v.y + two * (yz - wx) * v.z,
          two * (xz - wy) * v.x + two * (yz + wx) * v.y + ((ww + zz) - (xx + yy)) * v.z};
}

/// Normalises a q within 20 roundings of length 1 to within 4 roundings of it.
template <class T>
CLEARANCE_INLINE Quaternion<T> renormalised(const Quaternion<T>& q) {
  const T f = T(1.5) - T(0.5) * ((q.w * q.w + q.x * q.x) + (q.y * q.y + q.z * q.z));
  return {q.w * f, q.x * f, q.y * f, q.z * f};
}

}  // namespace clearance
