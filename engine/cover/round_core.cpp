#include "engine/cover/round_core.h"

#include <algorithm>
#include <cmath>

#include "engine/cover/hull_planes.h"
#include "engine/hull/shapes.h"

namespace clearance {

std::vector<Vec3d> polytope_around(const Primitive& core) {
  const Vec3d& size = core.size;
  if (core.kind == Primitive::Kind::kEllipsoid) {
    // A sphere's polytope, scaled until its faces' planes are at least 1 away from the centre.
    const Shape sphere = make_uv_sphere(1, 12);
    double nearest = 1;
    for (const Triangle& t : sphere.triangles) {
      const Vec3d &a = sphere.vertices[t[0]], &b = sphere.vertices[t[1]], &c = sphere.vertices[t[2]];
      const Vec3d n = cross(b - a, c - a);
      nearest = std::min(nearest, dot(n, a) / norm(n));
    }
    const double scale = 1.0001 / nearest;  // 1e-4 exceeds every rounding
    std::vector<Vec3d> vertices;
    for (const Vec3d& v : sphere.vertices)
      vertices.push_back({scale * size.x * v.x, scale * size.y * v.y, scale * size.z * v.z});
    return vertices;
  }
  std::vector<Vec3d> vertices = make_cylinder(size.x, 2 * size.z).vertices;
  if (core.kind == Primitive::Kind::kCone) {
    std::erase_if(vertices, [](const Vec3d& v) { return v.z > 0; });
    vertices.push_back({0, 0, size.z});
  }
  return vertices;
}

double in_core(const Primitive& core, const Vec3d& c) {
  const Vec3d& size = core.size;
  const double rounding = 8 * kCoverRounding * (norm(size) + norm(c)) + kCoverTiny,
               across = std::sqrt(c.x * c.x + c.y * c.y) * kCoverUp;
  switch (core.kind) {
    case Primitive::Kind::kHalfSpace:
      break;
    case Primitive::Kind::kCylinder:
      return std::min(size.x - across, size.z - std::abs(c.z)) - rounding;
    case Primitive::Kind::kCone: {
      // The side's outward normal is (2 half, radius) in the plane of the axis, scaled to length 1.
      const double slant = std::sqrt(4 * size.z * size.z + size.x * size.x);
      const double side = ((size.z - c.z) * size.x - across * 2 * size.z) / slant;
      return std::min(side, size.z + c.z) - rounding;
    }
    case Primitive::Kind::kEllipsoid:
      // In the unit sphere's space, a ball of radius r is in one of radius r / least half axis.
      return (1 - norm(Vec3d{c.x / size.x, c.y / size.y, c.z / size.z}) * kCoverUp) *
                 std::min({size.x, size.y, size.z}) -
             rounding;
  }
  return 0;
}

}  // namespace clearance
