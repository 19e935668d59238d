// How a joint places a link, as a certificate says it: moves, each in the frame of the one before, the first
// in the joint's origin.
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "engine/scene/scene_robot.h"

namespace clearance {

/// docs/certificates.md, "moves". \param stands positions of all of the scene's joints, where no query moves them
nlohmann::ordered_json moves_of(const RobotJoint& joint, const SceneRobot& robot, std::span<const double> stands);

}  // namespace clearance
