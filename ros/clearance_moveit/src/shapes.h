// Shapes of MoveIt as bodies of an engine.
#pragma once

#include <clearance/engine.h>
#include <geometric_shapes/shapes.h>

#include <cstdint>
#include <string>
#include <vector>

namespace clearance_moveit {

/// Where the bodies of a shape are, and what grows them.
struct Placement {
  std::uint32_t parent = clearance::kNone;  ///< body that they follow
  clearance::Pose7 pose{};                  ///< X_parent_shape, or X_world_shape without a parent
  double scale = 1;                         ///< about the shape's centre, as in MoveIt
  double padding = 0;                       ///< metres on all sides
};

/// Adds a shape to an engine: one body, or for an octree one for each size of its occupied cells. A closed mesh is the
/// solid that it encloses, an open one its triangles. Returns the names. Throws for other shapes, and adds none then.
/// \param stem of the names
std::vector<std::string> add_shape(clearance::Engine& engine, const std::string& stem, const shapes::Shape& shape,
                                   const Placement& placement);

}  // namespace clearance_moveit
