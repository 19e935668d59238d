// A joint's placement of its link in a certificate: moves, each in the frame of the previous one, the first in the
// joint's origin.
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "engine/scene/scene_robot.h"

namespace clearance {

/// Moves of a joint: docs/trust/certificates.md, "moves".
/// \param stands positions of all joints of the scene, used for those that no query moves
nlohmann::ordered_json moves_of(const RobotJoint& joint, const SceneRobot& robot, std::span<const double> stands);

}  // namespace clearance
