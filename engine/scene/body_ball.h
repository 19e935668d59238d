// A ball around a body's points.
#pragma once

#include "engine/robot/motion_path.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Holds all points of a body's pieces, and of what they stand for; body axes. Of a frame: its origin.
LinkBall ball_around(const Body& body);
/// Metres: no point of a body's pieces is farther from its origin; +inf for a half-space, 0 for a frame.
double extent_of(const Body& body);

}  // namespace clearance
