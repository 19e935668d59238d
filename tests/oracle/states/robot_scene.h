// Robots among obstacles of every kind, on which decisions about states are compared.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.h"
#include "tests/oracle/states/part_bounds.h"

namespace clearance::exact {

/// A robot, and movable bodies that a round of states places, or parks far away.
struct RobotScene {
  std::string name;
  engine::Scene scene = {}, robot = {};                   ///< with the obstacles, and without them
  std::vector<std::uint32_t> obstacles = {};              ///< ids of the movable ones
  std::vector<std::uint32_t> links = {};                  ///< ids of links with a shape that joints move
  std::vector<std::vector<PartBounds>> exact_parts = {};  ///< by body; empty for bodies that the oracle cannot solve

  /// Whether the oracle can solve the links.
  bool has_oracle() const { return !exact_parts[links[0]].empty(); }
};

/// A seeded arm whose links are of every kind, and bodies that follow it.
RobotScene made_robot(std::uint64_t seed);
/// A robot, with the SRDF of the same name if there is one. Throws SceneError.
/// \param urdf path; packages of its name and `meshes` lie next to it
RobotScene robot_of(const std::string& urdf, MeshAs mesh_as);

}  // namespace clearance::exact
