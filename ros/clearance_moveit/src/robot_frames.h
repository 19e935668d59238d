// A robot of MoveIt as a robot of the engine: a frame for each link, moved by the state's joint values.
#pragma once

#include <clearance/engine.h>

#include <cstdint>
#include <moveit/robot_state/robot_state.hpp>
#include <string>
#include <vector>

namespace clearance_moveit {

/// Joint values and the root's pose of states, as a query of an engine takes them.
struct Rows {
  std::vector<double> positions;        ///< (K, J), radians and metres
  std::vector<clearance::Pose7> poses;  ///< (K,) X_world_root of a root that moves, otherwise empty
};

/// Joints of a robot model without mimicking: a state has the values of those as well. Fixed, revolute and prismatic
/// joints, and a planar or floating root.
class RobotFrames {
 public:
  /// Throws std::invalid_argument for other joints, by name.
  explicit RobotFrames(const moveit::core::RobotModel& model);

  clearance::Engine make_engine() const;                              ///< with the frames alone
  static std::string frame(const moveit::core::LinkModel& link);      ///< its name in the engine
  std::vector<std::uint32_t> joints(const clearance::Engine&) const;  ///< ids for a query
  std::vector<std::uint32_t> movers(const clearance::Engine&) const;  ///< the root that moves, or none
  /// One row; or two, between which the joints move as RobotState::interpolate() moves them if is_straight().
  Rows rows(const moveit::core::RobotState& from, const moveit::core::RobotState* to) const;
  /// Whether interpolate() moves all joints straight: not a differential drive, nor a mimic joint of a continuous one.
  bool is_straight() const { return is_straight_; }

 private:
  void append(const moveit::core::RobotState& state, Rows& rows) const;

  std::string urdf_;
  const moveit::core::JointModel* root_;                    // that moves the robot, or null
  std::vector<const moveit::core::JointModel*> variables_;  // joints of one variable
  bool is_straight_ = true;
};

}  // namespace clearance_moveit
