// A ball around a body's points.
#pragma once

#include "engine/robot/motion_path.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Contains all points of a body's parts and of its exact geometry, in body axes. For a frame, its origin.
LinkBall ball_around(const Body& body);
/// Bound on the distance of a body's parts from its origin, in metres; +inf for a half-space, 0 for a frame.
double extent_of(const Body& body);

}  // namespace clearance
