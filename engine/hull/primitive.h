// Cores in closed form: convex sets that no finite number of vertices spans.
//
// Such a part has a single vertex, the origin, which is a point of the core, so that code that derives points from
// vertices gets points of the core. support() returns the reach along a direction, farthest() the point there.
#pragma once

#include <cmath>
#include <cstdint>

#include "engine/base/double_double.h"
#include "engine/hull/convex_part.h"

namespace clearance {

/// A core in the body's frame.
struct Primitive {
  enum class Kind : std::uint8_t {
    kHalfSpace = 1,  ///< all points with z <= 0; its part's extents do not apply, but certify_box() handles it
    kCone = 2,       ///< along z: a disc at -size.z, the apex at size.z
    kEllipsoid = 3,  ///< about the origin
    kCylinder = 4,   ///< along z: discs at -size.z and size.z
  };
  Kind kind;
  /// Metres: half extents. For a cone or cylinder radius, radius and half its length, for an ellipsoid its half axes;
  /// for a half-space 0.
  Vec3d size{0, 0, 0};

  friend bool operator==(const Primitive& a, const Primitive& b) {
    return a.kind == b.kind && a.size.x == b.size.x && a.size.y == b.size.y && a.size.z == b.size.z;
  }
};

/// Name in scene files.
const char* name_of(Primitive::Kind kind);

/// A part with a core in closed form, grown by a radius. Throws std::invalid_argument for a negative or non-finite
/// radius, and for sizes that are not above 0 and at most 1e60 m.
ConvexPartPtr make_primitive_part(const Primitive& primitive, double radius = 0);

inline bool is_half_space(const ConvexPart& part) {
  return part.primitive && part.primitive->kind == Primitive::Kind::kHalfSpace;
}
/// Whether a core is bounded, with a curved surface.
inline bool is_round(const ConvexPart& part) {
  return part.primitive && part.primitive->kind != Primitive::Kind::kHalfSpace;
}
/// Whether two parts' cores are the same primitive, or both hulls.
inline bool same_primitive(const ConvexPart& a, const ConvexPart& b) {
  return a.primitive && b.primitive ? *a.primitive == *b.primitive : a.primitive == b.primitive;
}

/// A point of a round core, and the core's reach along a direction.
template <class T>
struct FarthestPoint {
  Vec3<T> point;  ///< within 7 u rho of the core
  T value;        ///< n . x <= value + 5 u |n| rho for all x of it
};
/// The farthest point along n: any direction but zero, the body's frame. u is the unit roundoff of T:
/// docs/trust/bounds.md, round cores.
template <class T>
FarthestPoint<T> farthest(const Primitive& round, const Vec3<T>& n);

// Supports in closed form (docs/trust/bounds.md, round cores), for scalars of any arithmetic. Always inline, so that
// files compiled for one instruction set share no code with others.

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
