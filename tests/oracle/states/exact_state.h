// The oracle of decisions about states: kinematics in 60 digits, distances in exact arithmetic.
#pragma once

#include <span>
#include <vector>

#include "engine/engine.h"
#include "tests/oracle/states/robot_scene.h"

namespace clearance::exact {

/// Bounds on a body's parts in the world's frame, whose coordinates are rounded once.
struct PlacedBody {
  std::vector<PartBounds> parts;  ///< empty if the oracle cannot solve the body
};

/// The bodies of a scene with one robot.
/// \param engine has the poses of bodies that the robot does not move, and obstacles attached to links
/// \param positions of all joints
std::vector<PlacedBody> placed_bodies(const RobotScene& made, const engine::Engine& engine,
                                      std::span<const double> positions);

/// Whether two bodies are proved to be within a distance, or beyond it, by more than any rounding of coordinates. False
/// for bodies without parts.
bool is_nearer(const PlacedBody& a, const PlacedBody& b, double distance);
bool is_farther(const PlacedBody& a, const PlacedBody& b, double distance);

}  // namespace clearance::exact
