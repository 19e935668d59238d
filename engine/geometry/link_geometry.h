// The geometry of a robot's link: all its shapes, in the link's frame.
#pragma once

#include <vector>

#include "engine/geometry/geometry.h"
#include "engine/robot/robot.h"

namespace clearance {

/// A geometry whose own frame is X in its body. Its model_error and model_inner grow by what rounding moves a vertex at
/// most. Throws
/// std::invalid_argument for coordinates that are too large.
Geometry moved(const Geometry& geometry, const Origin& X);

/// The geometries of one body as one.
Geometry joined(std::vector<Geometry> parts);

}  // namespace clearance
