// Warnings about meshes that are probably not meant so: a hull far from its mesh, and a mesh so large that its file is
// probably in millimetres.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.h"

namespace clearance {

/// Share of a body's size above which a distance between its parts and its mesh gives a warning.
inline constexpr double kHullExcessShare = 0.02;

/// Width (largest edge of the bounding box, in metres) above which a mesh is probably not in metres.
inline constexpr double kLargeMesh = 50;

struct MeshWarning {
  std::uint32_t body;  ///< its id
  std::string text;    ///< with numbers and, for an open mesh, the file and an edge
};
/// Warnings about the bodies from `first` on, by id. Bodies that share a mesh are checked once.
std::vector<MeshWarning> mesh_warnings(const engine::Scene& scene, std::uint32_t first = 0);

/// Warning about one body, or empty. Takes time about linear in the size of its mesh.
std::string mesh_warning(const Body& body);

}  // namespace clearance
