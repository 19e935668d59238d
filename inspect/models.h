// Which model the bodies of a scene require for a margin, and what that costs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.h"
#include "inspect/choices.h"

namespace clearance {

/// A body and the value of `mesh_as` that it requires: kSolid, kSurface if the mesh is open, or kAuto for
/// several meshes.
struct MeshModel {
  std::uint32_t body = kNone;
  MeshAs mesh_as = MeshAs::kAuto;

  friend bool operator==(const MeshModel&, const MeshModel&) = default;
};

/// The bodies of a robot, or the other bodies of a kind, and the models that they could have.
struct GroupModel {
  std::string group;                   ///< the robot's name, "movable bodies", "static bodies" or "clouds"
  std::size_t bodies = 0;              ///< with geometry
  std::size_t concave = 0;             ///< bodies that are not proved convex
  std::size_t unknown = 0;             ///< of these, made of several meshes, without a bound for a hull
  double hull_excess = 0;              ///< metres: bound on how much too small distances of hulls are, of one body
  std::uint32_t farthest = kNone;      ///< the body with that bound
  std::uint64_t elements = 0;          ///< triangles of true meshes, or points of clouds
  std::uint64_t hull_vertices = 0;     ///< vertices of the hulls in their place
  std::optional<double> cost_ratio;    ///< time of a pair with true meshes over that with hulls, if measured
  std::vector<MeshModel> true_meshes;  ///< bodies whose hulls deviate by more than the margin
};

/// Returns a model for each robot, then for the other bodies.
/// \param choices of choices_of()
/// \param margin metres: hulls are precise enough for bodies that they deviate from by no more
std::vector<GroupModel> models_of(const engine::Scene& scene, const std::vector<Choice>& choices, double margin);

}  // namespace clearance
