// Parts of point clouds.
#pragma once

#include <span>

#include "engine/bvh/cloud_point.h"
#include "engine/hull/convex_part.h"

namespace clearance {

/// The box around a cloud as its part, grown by a radius. Throws std::invalid_argument as Surface and make_convex_part() do.
/// \param points at least one
ConvexPartPtr make_cloud_part(std::span<const CloudPoint> points, float voxel, double radius);

/// Placeholder part of an empty cloud, which is never evaluated.
ConvexPartPtr part_of_no_points();
/// The edge of voxels, rounded up to float32. Throws std::invalid_argument.
float voxel_of(double edge);

}  // namespace clearance
