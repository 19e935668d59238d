#include "engine/scene/geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/hull/hull.h"
#include "engine/hull/hull_excess.h"

namespace clearance {

namespace {

std::shared_ptr<const DisplayMesh> display_of(const Shape& shape) {
  Shape picture = picture_of(shape);
  auto display = std::make_shared<DisplayMesh>();
  display->vertices = std::move(picture.vertices);
  display->triangles = std::move(picture.triangles);
  return display;
}

// One product's: nothing where it is exact, as with powers of two.
double rounding_of_product(double a, double b, double product) {
  constexpr double kNoRemainderBelow = 0x1p-960;  // there the remainder might underflow
  const double off = std::abs(std::fma(a, b, -product));
  return std::abs(product) < kNoRemainderBelow && a != 0 && b != 0 ? std::numeric_limits<double>::min() : off;
}

// How far the scaled vertices may be from those that file and scale mean, metres.
double rounding_of(const std::vector<Submesh>& submeshes, const Vec3d& scale) {
  const double largest = std::max({std::abs(scale.x), std::abs(scale.y), std::abs(scale.z)});
  double worst = 0;
  for (const Submesh& submesh : submeshes) {
    worst = std::max(worst, largest * submesh.rounding);
    if (scale.x == 1 && scale.y == 1 && scale.z == 1) continue;
    for (const Vec3d& v : submesh.vertices) {
      double off = largest * submesh.rounding;
      for (int k = 0; k < 3; ++k) off += rounding_of_product(scale[k], v[k], scale[k] * v[k]);
      worst = std::max(worst, off);
    }
  }
  return worst * (1 + 0x1p-40);  // and of the sums above
}

// How far the pieces stand out of what they are the hulls of, and what that leaves empty.
class Excess {
 public:
  /// The piece of a mesh, as make_hull_piece() has it.
  PiecePtr add(const DisplayMesh& mesh, double radius, std::uint64_t loaded, bool distinct) {
    std::vector<Triangle> faces;
    PiecePtr piece = make_hull_piece(mesh.vertices, mesh.triangles, radius, loaded, distinct, &faces);
    const HullExcess excess = hull_excess(mesh.vertices, mesh.triangles, *piece, faces);
    distance_ = std::max(distance_, excess.distance);
    hull_ += excess.hull_volume;
    solid_ += excess.solid_volume;
    return piece;
  }
  double distance() const { return distance_; }
  double empty_share() const {
    return hull_ > 0 ? std::clamp(1 - solid_ / hull_, 0.0, 1.0) : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  double distance_ = 0, hull_ = 0, solid_ = 0;
};

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

std::string mesh_source(const std::string& file, Convexify convexify) {
  return file + (convexify == Convexify::kHull ? " (hull)" : " (submeshes)");
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
  Excess excess;
  if (convexify == Convexify::kHull) {
    out.pieces = {excess.add(*whole, radius, loaded, mesh.submeshes.size() == 1)};
  } else {
    for (const Submesh& submesh : mesh.submeshes)
      out.pieces.push_back(excess.add(joined({submesh}, scale), radius, submesh.loaded_vertices, true));
  }
  out.model_error = out.model_inner = rounding_of(mesh.submeshes, scale);
  out.hull_excess = excess.distance();
  out.empty_share = excess.empty_share();
  out.display = std::move(whole);
  out.source = mesh_source(source, convexify);
  return out;
}

}  // namespace clearance
