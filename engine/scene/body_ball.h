// A ball around a body's points.
#pragma once

#include "engine/robot/motion_path.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Holds all points of a body's pieces, and of what they stand for; body axes. Of a frame: its origin.
LinkBall ball_around(const Body& body);

}  // namespace clearance
