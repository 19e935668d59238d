// Distances of points from meshes and clouds, for the inner radii of covers.
#pragma once

#include "engine/base/vec.h"
#include "engine/bvh/surface.h"

namespace clearance {

/// If above 0, the radius of a ball about `c` that lies in the solid. Otherwise, a point of the body is no farther than
/// the negated value from `c`. Metres, body frame; rounding is charged.
double depth_in_mesh(const Surface& surface, const Vec3d& c);

}  // namespace clearance
