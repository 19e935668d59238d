#include "engine/cover/cover_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/fp_environment.h"
#include "engine/decomposition/fan.h"
#include "engine/hull/primitive.h"
#include "engine/hull/shapes.h"

namespace clearance {

namespace {

// More than every rounding of a sum of three products, relative to the sum of their magnitudes.
constexpr double kRounding = 0x1p-49;
constexpr double kUp = kCoverUp, kDown = 1 - 0x1p-48;

/// Vertices of a polytope around a round core.
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

double length(const Vec3d& v) {
  return norm(v) * kUp + kCoverTiny;
}

/// Upper bound on the distance of `c` from a point of the segment, the nearest one as computed.
double to_segment(const std::array<Vec3d, 2>& ends, const Vec3d& c) {
  const Vec3d along = ends[1] - ends[0];
  const double squared = dot(along, along);
  const double t = squared > 0 ? std::clamp(dot(c - ends[0], along) / squared, 0.0, 1.0) : 0.0;
  // The point of the segment at t, within the rounding of its own coordinates.
  const Vec3d p = ends[0] * (1 - t) + ends[1] * t;
  return length(c - p) + kRounding * (norm(ends[0]) + norm(ends[1]));
}

/// Radius of a ball about `c` in a round core, or a value not above 0.
double in_core(const Primitive& core, const Vec3d& c) {
  const Vec3d& size = core.size;
  const double rounding = 8 * kRounding * (norm(size) + norm(c)) + kCoverTiny,
               across = std::sqrt(c.x * c.x + c.y * c.y) * kUp;
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
      return (1 - norm(Vec3d{c.x / size.x, c.y / size.y, c.z / size.z}) * kUp) * std::min({size.x, size.y, size.z}) -
             rounding;
  }
  return 0;
}

}  // namespace

std::optional<CoverShape> CoverShape::of(std::span<const ConvexPartPtr> parts) {
  const FpEnvironment environment;
  if (parts.empty() ||
      std::any_of(parts.begin(), parts.end(), [](const auto& part) { return is_half_space(*part) || part->surface; }))
    return {};
  CoverShape shape;
  for (const ConvexPartPtr& part : parts) shape.add(*part);
  return shape;
}

void CoverShape::add(const ConvexPart& part) {
  reach_ = std::max(reach_, (part.rho + part.radius) * kUp);
  const std::optional<Fan> fan = part.primitive             ? fan_of(polytope_around(*part.primitive))
                                 : part.vertices.size() > 3 ? fan_of(part.vertices)
                                                            : std::optional<Fan>{};
  Part added;
  added.radius = part.radius;
  added.core = part.primitive;
  added.vertices = part.vertices;
  if (!fan) {
    add_flat(part);
    parts_.push_back(std::move(added));
    return;
  }
  for (const auto& tetrahedron : fan->parts) {
    CoverSimplex simplex{{}, (part.radius + fan->off) * kUp};
    for (int k = 0; k < 4; ++k) simplex.corner[k] = fan->points[tetrahedron[k]];
    simplices_.push_back(simplex);
    for (const Vec3d& corner : simplex.corner) reach_ = std::max(reach_, length(corner) + simplex.growth);
  }
  if (!part.primitive && !added.take_planes(*fan)) added.normal_x.clear();
  parts_.push_back(std::move(added));
}

/// Simplices of a part without volume, or whose faces are not proved.
void CoverShape::add_flat(const ConvexPart& part) {
  const auto& v = part.vertices;
  if (v.size() <= 3 && !part.primitive) {
    simplices_.push_back({{v[0], v[v.size() > 1 ? 1 : 0], v.back(), v.back()}, part.radius});
    return;
  }
  const Fan box = box_around(part);
  for (const auto& tetrahedron : box.parts) {
    CoverSimplex simplex{{}, part.radius};
    for (int k = 0; k < 4; ++k) simplex.corner[k] = box.points[tetrahedron[k]];
    simplices_.push_back(simplex);
    for (const Vec3d& corner : simplex.corner) reach_ = std::max(reach_, length(corner) + simplex.growth);
  }
}

/// The fan's tetrahedra are points x with n . x <= the least n . v of the face's corners v, for any n that puts the
/// centre below that height. Returns false if a face has no such n.
bool CoverShape::Part::take_planes(const Fan& fan) {
  const Vec3d& middle = fan.points.back();
  for (const auto& face : fan.parts) {
    const Vec3d &a = fan.points[face[0]], &b = fan.points[face[1]], &c = fan.points[face[2]];
    Vec3d n = cross(b - a, c - a);
    const double size = norm(n);
    if (!(size > 0)) return false;
    n = n * (kDown / size);  // shorter than 1
    const double low = std::min({dot(n, a), dot(n, b), dot(n, c)}) - kRounding * (norm(a) + norm(b) + norm(c));
    if (!(dot(n, middle) + kRounding * norm(middle) < low)) return false;
    normal_x.push_back(n.x);
    normal_y.push_back(n.y);
    normal_z.push_back(n.z);
    height.push_back(low);
  }
  return true;
}

double CoverShape::Part::inside(const Vec3d& c) const {
  if (core) {
    const double depth = in_core(*core, c);
    return (depth > 0 ? depth : -length(c)) + radius;  // the origin is a point of the core
  }
  if (vertices.size() <= 2) return radius - to_segment({vertices.front(), vertices.back()}, c);
  double depth = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < height.size(); ++i)
    depth = std::min(depth, height[i] - (normal_x[i] * c.x + normal_y[i] * c.y + normal_z[i] * c.z));
  depth -= kRounding * 2 * norm(c);
  if (!height.empty() && depth > 0) return depth * kDown + radius;
  double nearest = std::numeric_limits<double>::infinity();
  for (const Vec3d& v : vertices) nearest = std::min(nearest, squared_norm(c - v));
  return radius - std::sqrt(nearest) * kUp - kCoverTiny;
}

double CoverShape::inside(const Vec3d& c) const {
  double most = -std::numeric_limits<double>::infinity();
  for (const Part& part : parts_) most = std::max(most, part.inside(c));
  return most;
}

}  // namespace clearance
