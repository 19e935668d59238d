// Tests whether one of two bodies that do not touch is within the other.
#pragma once

#include <cstdint>

#include "engine/narrow/work_meter.h"
#include "engine/pose/placed.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Whether a connected component of one body lies within a solid of the other, whose elements are proved apart.
/// kUnknown if they are so near that rounding may move the tested point through a triangle.
/// \param apart lower bound on the distance between their elements, metres
/// \param point for kYes, receives a point that both share, from the origin of either, world axes
enum class Containment { kNo, kUnknown, kYes };
Containment either_contains(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                            double apart, WorkMeter& meter, Vec3d (&point)[2]);

}  // namespace clearance
