// What a body is made of, from each of the things that a scene may name.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/hull/primitive.h"
#include "engine/hull/shapes.h"
#include "engine/mesh/mesh.h"
#include "engine/scene/scene.h"

namespace clearance {

struct Decomposition;  // engine/hull/decomposition.h

/// Everything of a Body that bodies of the same shape share.
struct Geometry {
  std::vector<PiecePtr> pieces;
  std::shared_ptr<const DisplayMesh> display;  ///< may be null
  double model_error = 0, model_inner = 0;
  double hull_excess = 0, empty_share = 0;
  std::string source;
  float empty_voxel = 0;  ///< edge of the voxels of an octomap that has none; else 0
};

/// \param radius grows the pieces; added to that of the shape. All throw std::invalid_argument for bad numbers.
Geometry geometry_of_shape(const Shape& shape, double radius, const std::string& source);
Geometry geometry_of_primitive(const Primitive& primitive, double radius, const std::string& source);
/// The primitive of a cone or a cylinder of this radius and length.
Primitive cone_of(double radius, double length);
Primitive cylinder_of(double radius, double length);
/// For whoever knows hulls alone: the prism around a cylinder, grown as it is; any other piece as it is.
PiecePtr with_prism(const PiecePtr& piece);
Geometry geometry_of_points(std::span<const Vec3d> points, double radius);
/// The hull of a surface's vertices, which stands for it, grown by a radius. Throws std::invalid_argument as Surface
/// and make_piece() do. \param loaded_vertices of the mesh; 0: those given
PiecePtr make_surface_piece(std::vector<Vec3d> vertices, std::vector<Triangle> triangles, bool is_solid, double radius,
                            std::uint64_t loaded_vertices = 0,
                            std::shared_ptr<const Decomposition> decomposition = nullptr);
/// The same of a solid, and pieces that stand for it, of which it is proved how far they miss it. \param proposed the
/// vertices of each piece
PiecePtr make_decomposed_piece(std::vector<Vec3d> vertices, std::vector<Triangle> triangles,
                               std::span<const std::vector<Vec3d>> proposed, double radius,
                               std::uint64_t loaded_vertices = 0);
/// The same piece, and what it stands for, grown by another radius.
PiecePtr with_radius(const Piece& piece, double radius);
/// A surface's triangles in the order in which it was given them.
std::vector<Triangle> triangles_as_loaded(const Surface& surface);
/// How the source of a body ends that has kDecompose and no pieces.
inline constexpr std::string_view kNoPiecesYet = "(solid: no pieces yet)";
/// What Body::source says of a mesh file. \param made of it, which says what kAuto has become
std::string mesh_source(const std::string& file, Convexify convexify, const Geometry& made);
/// How a mesh file becomes a body's geometry.
struct MeshRecipe {
  Vec3d scale{1, 1, 1};  ///< per axis, in the file's frame; negative mirrors
  Convexify convexify = Convexify::kAuto;
  double radius = 0;  ///< metres, added to the pieces
  UpAxis up = UpAxis::kZ;
};
/// Geometry of a mesh. That of a surface or solid is exact.
/// \param source the file's name
/// \param pieces for kDecompose, each a submesh in the file's frame; null: a solid without pieces
Geometry geometry_of_mesh(const Mesh& mesh, const MeshRecipe& recipe, const std::string& source,
                          const Mesh* pieces = nullptr);
/// The same of a mesh that the caller has, in the body's frame.
Geometry geometry_of_triangles(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                               Convexify convexify, double radius);

}  // namespace clearance
