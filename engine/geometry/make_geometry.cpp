#include "engine/geometry/make_geometry.h"

#include "engine/base/digest.h"
#include "engine/bvh/surface.h"
#include "engine/hull/hull.h"

namespace clearance {

namespace {

std::shared_ptr<const DisplayMesh> display_of(const Shape& shape) {
  Shape picture = picture_of(shape);
  auto display = std::make_shared<DisplayMesh>();
  display->vertices = std::move(picture.vertices);
  display->triangles = std::move(picture.triangles);
  return display;
}

// Display mesh of a round primitive: points on its surface, or just outside.
Shape picture_of(const Primitive& round) {
  constexpr int kResolution = 16;
  const Vec3d& size = round.size;
  if (round.kind == Primitive::Kind::kCylinder) return make_cylinder(size.x, 2 * size.z);
  if (round.kind == Primitive::Kind::kEllipsoid) {
    Shape picture = make_uv_sphere(1, kResolution);
    for (Vec3d& v : picture.vertices) v = {v.x * size.x, v.y * size.y, v.z * size.z};
    return picture;
  }
  constexpr std::uint32_t kAround = 2 * kResolution;
  Shape cone;
  cone.vertices = {{0, 0, size.z}, {0, 0, -size.z}};
  for (std::uint32_t j = 0; j < kAround; ++j) {
    double sine, cosine;
    sin_cos_pi(2 * j, kAround, &sine, &cosine);
    cone.vertices.push_back({size.x * cosine, size.x * sine, -size.z});
    const std::uint32_t here = 2 + j, next = 2 + (j + 1) % kAround;
    cone.triangles.push_back({0, here, next});
    cone.triangles.push_back({1, next, here});
  }
  return cone;
}

std::uint64_t digest_of(const Surface& surface, double radius) {
  Digest digest;
  digest.add(surface.digest());
  digest.add(radius);
  return digest.value();
}

}  // namespace

ConvexPartPtr make_surface_part(std::vector<Vec3d> vertices, std::vector<Triangle> triangles, bool is_solid,
                                double radius, std::uint64_t loaded_vertices) {
  // The hull first, because it checks the coordinates.
  const ConvexPartPtr hull = make_hull_part(vertices, {}, radius, loaded_vertices);
  const auto surface = std::make_shared<const Surface>(std::move(vertices), std::move(triangles), is_solid);
  return make_convex_part(hull->vertices, radius, hull->loaded_vertices, digest_of(*surface, radius), hull->table,
                          surface);
}

ConvexPartPtr with_radius(const ConvexPart& part, double radius) {
  if (part.primitive) return make_primitive_part(*part.primitive, radius);
  const std::uint64_t digest = part.surface ? digest_of(*part.surface, radius) : 0;
  return make_convex_part(part.vertices, radius, part.loaded_vertices, digest, part.table, part.surface);
}

std::vector<Triangle> triangles_as_loaded(const Surface& surface) {
  std::vector<Triangle> triangles(surface.triangles().size());
  for (std::size_t i = 0; i < triangles.size(); ++i) triangles[surface.places()[i]] = surface.triangles()[i];
  return triangles;
}

Geometry geometry_of_shape(const Shape& shape, double radius, const std::string& source) {
  Shape grown = shape;
  grown.radius += radius;
  Geometry out;
  out.parts = {make_hull_part(shape.vertices, shape.triangles, grown.radius)};
  out.display = display_of(shape.radius > 0 ? grown : shape);  // boxes and prisms are shown without their rounding
  out.model_error = shape.model_error;
  out.source = source;
  return out;
}

Geometry geometry_of_primitive(const Primitive& primitive, double radius, const std::string& source) {
  Geometry out;
  out.parts = {make_primitive_part(primitive, radius)};
  if (primitive.kind != Primitive::Kind::kHalfSpace) out.display = display_of(picture_of(primitive));
  out.source = source;
  return out;
}

Primitive cone_of(double radius, double length) {
  return {Primitive::Kind::kCone, {radius, radius, 0.5 * length}};
}

Primitive cylinder_of(double radius, double length) {
  return {Primitive::Kind::kCylinder, {radius, radius, 0.5 * length}};
}

Geometry geometry_of_points(std::span<const Vec3d> points, double radius) {
  Geometry out;
  auto display = std::make_shared<DisplayMesh>();
  out.parts = {make_hull_part(points, {}, radius, 0, false, &display->triangles)};
  display->vertices = out.parts[0]->vertices;
  if (!display->triangles.empty()) out.display = std::move(display);
  out.source = "points";
  return out;
}

}  // namespace clearance
