#include "geometry.h"

#include <cmath>
#include <stdexcept>

#include "hull.h"

namespace clearance {

namespace {

std::shared_ptr<const DisplayMesh> display_of(const Shape& shape) {
  Shape picture = picture_of(shape);
  auto display = std::make_shared<DisplayMesh>();
  display->vertices = std::move(picture.vertices);
  display->triangles = std::move(picture.triangles);
  return display;
}

// The mesh as one, scaled: vertices and triangles of all submeshes, one after another.
DisplayMesh joined(const std::vector<Submesh>& submeshes, const Vec3d& scale) {
  std::size_t vertices = 0, triangles = 0;
  for (const Submesh& submesh : submeshes) {
    vertices += submesh.vertices.size();
    triangles += submesh.triangles.size();
  }
  DisplayMesh out;
  out.vertices.reserve(vertices);
  out.triangles.reserve(triangles);
  const bool mirrored = ((scale.x < 0) != (scale.y < 0)) != (scale.z < 0);
  for (const Submesh& submesh : submeshes) {
    const auto base = static_cast<std::uint32_t>(out.vertices.size());
    for (const Vec3d& v : submesh.vertices) out.vertices.push_back({scale.x * v.x, scale.y * v.y, scale.z * v.z});
    for (const Triangle& t : submesh.triangles)
      if (mirrored)
        out.triangles.push_back({base + t[0], base + t[2], base + t[1]});
      else
        out.triangles.push_back({base + t[0], base + t[1], base + t[2]});
  }
  return out;
}

}  // namespace

Geometry geometry_of_shape(const Shape& shape, double radius, const std::string& source) {
  Shape grown = shape;
  grown.radius += radius;
  Geometry out;
  out.pieces = {make_hull_piece(shape.vertices, shape.triangles, grown.radius)};
  out.display = display_of(shape.radius > 0 ? grown : shape);  // boxes and prisms are shown without their rounding
  out.model_error = shape.model_error;
  out.source = source;
  return out;
}

Geometry geometry_of_points(std::span<const Vec3d> points, double radius) {
  Geometry out;
  auto display = std::make_shared<DisplayMesh>();
  out.pieces = {make_hull_piece(points, {}, radius, 0, false, &display->triangles)};
  display->vertices = out.pieces[0]->vertices;
  if (!display->triangles.empty()) out.display = std::move(display);
  out.source = "points";
  return out;
}

Geometry geometry_of_mesh(const Mesh& mesh, const Vec3d& scale, Convexify convexify, double radius,
                          const std::string& source) {
  for (int k = 0; k < 3; ++k)
    if (!(std::abs(scale[k]) > 0 && std::abs(scale[k]) <= kMaxCoordinate))
      throw std::invalid_argument("scale: expected finite numbers other than 0, got " + std::to_string(scale[k]));
  if (convexify == Convexify::kDecompose)
    throw std::invalid_argument(
        "not yet: convexify: decompose (approximate convex decomposition); use hull or submeshes");
  std::uint64_t loaded = 0;
  for (const Submesh& submesh : mesh.submeshes) loaded += submesh.loaded_vertices;
  auto whole = std::make_shared<DisplayMesh>(joined(mesh.submeshes, scale));
  Geometry out;
  if (convexify == Convexify::kHull) {
    out.pieces = {make_hull_piece(whole->vertices, whole->triangles, radius, loaded, mesh.submeshes.size() == 1,
                                  nullptr, mesh.path)};
    out.source = source + " (hull)";
  } else {
    for (const Submesh& submesh : mesh.submeshes) {
      const DisplayMesh part = joined({submesh}, scale);
      out.pieces.push_back(make_hull_piece(part.vertices, part.triangles, radius, submesh.loaded_vertices, true, nullptr,
                                           mesh.path));
    }
    out.source = source + " (submeshes)";
  }
  out.display = std::move(whole);
  return out;
}

}  // namespace clearance
