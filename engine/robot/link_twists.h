// Velocities of a robot's links for changing positions: the first derivative of its kinematics.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/robot/kinematics.h"
#include "engine/robot/motion_path_step.h"

namespace clearance {

/// Subject to rounding: direction and position of an axis have the errors of its link (Kinematics::error).
class LinkTwists {
 public:
  /// \param robot must outlive this object
  explicit LinkTwists(const Kinematics& robot);

  /// Computes the twists of all links relative to their roots.
  /// \param poses (links,) results of Kinematics::place() with roots at the identity
  /// \param change (columns,) change of each position per unit of time
  /// \param twists (links,) results, in the axes of their roots
  void at(std::span<const Pose> poses, std::span<const double> change, std::span<Twist> twists) const;

 private:
  const Kinematics& robot_;
  std::vector<Vec3d> axes_;           // axes of the turning steps, in their links' frames
  std::vector<std::uint32_t> links_;  // links of the steps' parent frames
};

}  // namespace clearance
