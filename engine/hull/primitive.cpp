// Compiled with -ffp-contract=off: docs/trust/bounds.md, round cores, counts each rounding.
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

template <class T>
FarthestPoint<T> farthest(const Primitive& round, const Vec3<T>& n) {
  assert(round.kind != Primitive::Kind::kHalfSpace);
  return farthest_of_round(round, n);
}
template FarthestPoint<double> farthest(const Primitive&, const Vec3<double>&);
template FarthestPoint<DoubleDouble> farthest(const Primitive&, const Vec3<DoubleDouble>&);

}  // namespace clearance
