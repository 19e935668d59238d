// Makes geometry from shapes, points and meshes.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/geometry/geometry.h"
#include "engine/hull/primitive.h"
#include "engine/hull/shapes.h"
#include "engine/mesh/mesh.h"
#include "wire/mesh_as.h"

namespace clearance {

/// All of these throw std::invalid_argument for bad numbers.
/// \param radius added to the parts' radius, in metres
Geometry geometry_of_shape(const Shape& shape, double radius, const std::string& source);
Geometry geometry_of_primitive(const Primitive& primitive, double radius, const std::string& source);
Geometry geometry_of_points(std::span<const Vec3d> points, double radius);
/// The primitive of a cone or a cylinder of this radius and length.
Primitive cone_of(double radius, double length);
Primitive cylinder_of(double radius, double length);

/// Makes a part of a surface or solid mesh, enclosed by the hull of its vertices.
/// Throws std::invalid_argument as Surface and make_convex_part() do.
/// \param loaded_vertices of the mesh file; 0 for the number given
ConvexPartPtr make_surface_part(std::vector<Vec3d> vertices, std::vector<Triangle> triangles, bool is_solid,
                                double radius, std::uint64_t loaded_vertices = 0);
/// Returns the same part, with its exact geometry, grown by another radius.
ConvexPartPtr with_radius(const ConvexPart& part, double radius);
/// A surface's triangles in the order of its mesh.
std::vector<Triangle> triangles_as_loaded(const Surface& surface);

/// Options that turn a mesh file into a body's geometry.
struct MeshRecipe {
  Vec3d scale{1, 1, 1};  ///< per axis, in the file's frame; negative mirrors
  MeshAs mesh_as = MeshAs::kAuto;
  double radius = 0;  ///< metres, added to the parts
  UpAxis up = UpAxis::kZ;
};
/// Geometry of a mesh; that of a surface or solid is exact. Throws std::invalid_argument.
/// \param source the file's name
Geometry geometry_of_mesh(const Mesh& mesh, const MeshRecipe& recipe, const std::string& source);
/// Geometry of a mesh given in the body's frame.
Geometry geometry_of_triangles(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, MeshAs mesh_as,
                               double radius);
/// Geometry::source of a mesh file.
/// \param made of it, which resolves kAuto
std::string mesh_source(const std::string& file, MeshAs mesh_as, const Geometry& made);

}  // namespace clearance
