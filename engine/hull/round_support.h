// Supports of round cores in closed form (docs/bounds.md, round cores), for scalars of any arithmetic. Always inline, so
// that files compiled for one instruction set share no code with others.
#pragma once

#include <cmath>

#include "engine/hull/primitive.h"

namespace clearance {

/// h(n) = |A n| for A of the half axes, at A A n / |A n|.
template <class T>
CLEARANCE_INLINE FarthestPoint<T> farthest_of_ellipsoid(const Vec3d& axes, const Vec3<T>& n) {
  using std::sqrt;
  const T ax(axes.x), ay(axes.y), az(axes.z), x = ax * n.x, y = ay * n.y, z = az * n.z;
  const T length = sqrt(x * x + y * y + z * z);
  if (!(length > T(0))) return {{T(0), T(0), T(0)}, T(0)};
  return {{ax * (x / length), ay * (y / length), az * (z / length)}, length};
}

/// The apex, or the point of the base's rim.
template <class T>
CLEARANCE_INLINE FarthestPoint<T> farthest_of_cone(const Vec3d& size, const Vec3<T>& n) {
  using std::sqrt;
  const T radius(size.x), half(size.z), zero(0), across = sqrt(n.x * n.x + n.y * n.y);
  const T at_apex = half * n.z, at_base = radius * across - half * n.z;
  if (at_apex > at_base) return {{zero, zero, half}, at_apex};
  if (!(across > zero)) return {{zero, zero, -half}, at_base};
  return {{radius * (n.x / across), radius * (n.y / across), -half}, at_base};
}

/// A point of the rim of the disc that is farther; the disc's middle along the axis.
template <class T>
CLEARANCE_INLINE FarthestPoint<T> farthest_of_cylinder(const Vec3d& size, const Vec3<T>& n) {
  using std::sqrt;
  const T radius(size.x), zero(0), across = sqrt(n.x * n.x + n.y * n.y);
  const T half = n.z < zero ? T(-size.z) : T(size.z), value = radius * across + half * n.z;
  if (!(across > zero)) return {{zero, zero, half}, value};
  return {{radius * (n.x / across), radius * (n.y / across), half}, value};
}

/// As farthest().
template <class T>
CLEARANCE_INLINE FarthestPoint<T> farthest_of_round(const Primitive& round, const Vec3<T>& n) {
  if (round.kind == Primitive::Kind::kEllipsoid) return farthest_of_ellipsoid(round.size, n);
  return round.kind == Primitive::Kind::kCone ? farthest_of_cone(round.size, n) : farthest_of_cylinder(round.size, n);
}

}  // namespace clearance
