// Geometry of a robot's link: all its shapes, in the link's frame.
#pragma once

#include <vector>

#include "engine/geometry/geometry.h"
#include "engine/robot/robot.h"

namespace clearance {

/// Moves a geometry to X in its body. Its model_error and model_inner grow by the rounding of a vertex. Throws
/// std::invalid_argument for coordinates that are too large.
Geometry moved(const Geometry& geometry, const Origin& X);

/// Joins the geometries of one body.
Geometry joined(std::vector<Geometry> parts);

}  // namespace clearance
