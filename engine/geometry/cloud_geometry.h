// What bodies of points are made of.
#pragma once

#include <span>

#include "engine/bvh/cloud_point.h"
#include "engine/hull/piece.h"

namespace clearance {

/// The box around a cloud, which stands for it, grown by a radius. Throws std::invalid_argument as Surface and
/// make_piece() do. \param points at least one
PiecePtr make_cloud_piece(std::span<const CloudPoint> points, float voxel, double radius);

/// What stands where there are no points: nothing that is ever asked about.
PiecePtr piece_of_no_points();
/// The edge of voxels as they count: the float32 that is not below it. Throws std::invalid_argument.
float voxel_of(double edge);

}  // namespace clearance
