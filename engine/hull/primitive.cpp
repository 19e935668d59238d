// Compiled with -ffp-contract=off: docs/bounds.md, round cores, counts each rounding.
#include "engine/hull/primitive.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <string>

#include "engine/base/digest.h"
#include "engine/base/fp_environment.h"
#include "engine/pose/pose.h"

namespace clearance {

const char* name_of(Primitive::Kind kind) {
  switch (kind) {
    case Primitive::Kind::kHalfSpace:
      return "half_space";
    case Primitive::Kind::kCone:
      return "cone";
    case Primitive::Kind::kEllipsoid:
      return "ellipsoid";
    case Primitive::Kind::kCylinder:
      return "cylinder";
  }
  return "";
}

ConvexPartPtr make_primitive_part(const Primitive& primitive, double radius) {
  const FpEnvironment environment;
  const bool is_bounded = primitive.kind != Primitive::Kind::kHalfSpace;
  Digest digest;
  digest.add(std::string_view("primitive"));
  digest.add(static_cast<std::uint64_t>(primitive.kind));
  digest.add(primitive.size);
  digest.add(radius);
  for (int k = 0; k < 3 && is_bounded; ++k)
    if (!(primitive.size[k] > 0 && primitive.size[k] <= kMaxCoordinate))
      throw std::invalid_argument("expected sizes above 0 and up to 1e60 m, got " + std::to_string(primitive.size[k]));
  auto part = std::make_shared<ConvexPart>(*make_convex_part({{0, 0, 0}}, radius, 0, digest.value()));
  part->primitive = std::make_shared<const Primitive>(primitive);
  const auto& [x, y, z] = part->half = primitive.size;
  const double far = primitive.kind == Primitive::Kind::kEllipsoid ? std::max({x, y, z}) : std::hypot(x, z);
  part->rho = part->spread = far * (1 + 0x1p-48);
  return part;
}

namespace {

// h(n) = |A n| for A of the half axes, at A A n / |A n|.
template <class T>
FarthestPoint<T> farthest_of_ellipsoid(const Vec3d& axes, const Vec3<T>& n) {
  const Vec3<T> A = cast<T>(axes), m{A.x * n.x, A.y * n.y, A.z * n.z};
  const T length = norm(m);
  if (!(length > T(0))) return {{T(0), T(0), T(0)}, T(0)};
  return {{A.x * (m.x / length), A.y * (m.y / length), A.z * (m.z / length)}, length};
}

// The apex, or the point of the base's rim.
template <class T>
FarthestPoint<T> farthest_of_cone(const Vec3d& size, const Vec3<T>& n) {
  using std::sqrt;
  const T radius(size.x), half(size.z), zero(0), across = sqrt(n.x * n.x + n.y * n.y);
  const T at_apex = half * n.z, at_base = radius * across - half * n.z;
  if (at_apex > at_base) return {{zero, zero, half}, at_apex};
  if (!(across > zero)) return {{zero, zero, -half}, at_base};
  return {{radius * (n.x / across), radius * (n.y / across), -half}, at_base};
}

// A point of the rim of the disc that is farther; the disc's middle along the axis.
template <class T>
FarthestPoint<T> farthest_of_cylinder(const Vec3d& size, const Vec3<T>& n) {
  using std::sqrt;
  const T radius(size.x), zero(0), across = sqrt(n.x * n.x + n.y * n.y);
  const T half = n.z < zero ? T(-size.z) : T(size.z), value = radius * across + half * n.z;
  if (!(across > zero)) return {{zero, zero, half}, value};
  return {{radius * (n.x / across), radius * (n.y / across), half}, value};
}

}  // namespace

template <class T>
FarthestPoint<T> farthest(const Primitive& round, const Vec3<T>& n) {
  assert(round.kind != Primitive::Kind::kHalfSpace);
  if (round.kind == Primitive::Kind::kEllipsoid) return farthest_of_ellipsoid(round.size, n);
  return round.kind == Primitive::Kind::kCone ? farthest_of_cone(round.size, n) : farthest_of_cylinder(round.size, n);
}
template FarthestPoint<double> farthest(const Primitive&, const Vec3<double>&);
template FarthestPoint<DoubleDouble> farthest(const Primitive&, const Vec3<DoubleDouble>&);

}  // namespace clearance
