// What a body is made of, from each of the things that a scene may name.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/hull/shapes.h"
#include "engine/mesh/mesh.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Everything of a Body that bodies of the same shape share.
struct Geometry {
  std::vector<PiecePtr> pieces;
  std::shared_ptr<const DisplayMesh> display;  ///< may be null
  double model_error = 0, model_inner = 0;
  double hull_excess = 0, empty_share = 0;
  std::string source;
};

/// \param radius grows the pieces; added to that of the shape. All throw std::invalid_argument for bad numbers.
Geometry geometry_of_shape(const Shape& shape, double radius, const std::string& source);
Geometry geometry_of_points(std::span<const Vec3d> points, double radius);
/// What Body::source says of a mesh file.
std::string mesh_source(const std::string& file, Convexify convexify);
/// \param source names the file. \param scale per axis, in the file's frame; negative mirrors.
Geometry geometry_of_mesh(const Mesh& mesh, const Vec3d& scale, Convexify convexify, double radius,
                          const std::string& source);

}  // namespace clearance
