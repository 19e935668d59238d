// Robots as their files and options describe them, before they have bodies.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene_robot.h"

namespace clearance {

/// Reads the URDF and SRDF. Throws SceneError.
std::shared_ptr<SceneRobot> read_robot_files(const std::string& name, const engine::RobotOptions& options);
/// Throws SceneError for names that are too long, bad padding, and links that the robot lacks.
void check_robot_options(const SceneRobot& robot, const engine::RobotOptions& options);
/// Positions at load, by column; empty for joints without one. Throws SceneError.
std::vector<std::optional<double>> home_positions(const SceneRobot& robot, const engine::RobotOptions& options);
/// Digest of the meaning of joint ids and link poses: equal for the same files, wherever the bodies are in a scene.
std::uint64_t digest_of(const SceneRobot& robot);

}  // namespace clearance
