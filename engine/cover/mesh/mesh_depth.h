// Distances of points from meshes and clouds, for the inner radii of covers.
#pragma once

#include <cstdint>

#include "engine/base/vec.h"
#include "engine/bvh/surface.h"

namespace clearance {

/// If above 0, the radius of a ball about `c` that lies in the solid. Otherwise, a point of the body is no farther than
/// the negated value from `c`. Metres, body frame; rounding is charged.
/// \param enough a result that is no greater may be any that is no greater
/// \param near a triangle that may be the nearest, where the search begins; receives the nearest found
double depth_in_mesh(const Surface& surface, const Vec3d& c, double enough, std::uint32_t& near);
/// The same for a cloud, by its nearest point.
double depth_in_cloud(const Surface& cloud, const Vec3d& c, std::uint32_t& near);

}  // namespace clearance
