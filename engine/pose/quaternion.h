// Quaternions over any scalar: what kinematics is made of, for one configuration, SIMD lanes and a GPU alike.
#pragma once

#include "engine/base/vec.h"

namespace clearance {

template <class T>
struct Quaternion {
  T w, x, y, z;
};

/// The turn b and then, seen from outside, a. Each component errs by 3 roundings of the sum of its terms' sizes at
/// most.
template <class T>
CLEARANCE_INLINE Quaternion<T> product(const Quaternion<T>& a, const Quaternion<T>& b) {
  return {(a.w * b.w - a.x * b.x) - (a.y * b.y + a.z * b.z), (a.w * b.x + a.x * b.w) + (a.y * b.z - a.z * b.y),
          (a.w * b.y + a.y * b.w) + (a.z * b.x - a.x * b.z), (a.w * b.z + a.z * b.w) + (a.x * b.y - a.y * b.x)};
}

/// M(q) v: for a q of length 1 + d, v turned and longer by a factor of (1 + d)^2.
template <class T>
CLEARANCE_INLINE Vec3<T> turned(const Quaternion<T>& q, const Vec3<T>& v) {
  const T two(2.0);
  const T ww = q.w * q.w, xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
  const T wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z, xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
  return {((ww + xx) - (yy + zz)) * v.x + two * (xy - wz) * v.y + two * (xz + wy) * v.z,
          two * (xy + wz) * v.x + ((ww + yy) - (xx + zz)) * v.y + two * (yz - wx) * v.z,
          two * (xz - wy) * v.x + two * (yz + wx) * v.y + ((ww + zz) - (xx + yy)) * v.z};
}

/// Of a q that is within 20 roundings of length 1: the same turn, within 4 roundings of length 1.
template <class T>
CLEARANCE_INLINE Quaternion<T> renormalised(const Quaternion<T>& q) {
  const T f = T(1.5) - T(0.5) * ((q.w * q.w + q.x * q.x) + (q.y * q.y + q.z * q.z));
  return {q.w * f, q.x * f, q.y * f, q.z * f};
}

}  // namespace clearance
