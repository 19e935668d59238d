// How fast the links of a robot move while its positions change: the first derivative of its kinematics.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/robot/kinematics.h"
#include "engine/robot/motion_path_step.h"

namespace clearance {

/// Rounded: an axis is off by no more than its link is turned, and lies beside its place by no more than its link is
/// (Kinematics::error).
class LinkTwists {
 public:
  /// \param robot must outlive this.
  explicit LinkTwists(const Kinematics& robot);

  /// As seen from the roots. \param poses (links,) as placed by Kinematics::place() under roots at the identity.
  /// \param change (columns,) of each position in a unit of time. \param twists (links,) in the axes of their roots
  void at(std::span<const Pose> poses, std::span<const double> change, std::span<Twist> twists) const;

 private:
  const Kinematics& robot_;
  std::vector<Vec3d> axes_;           // of the steps that turn, in their links' axes
  std::vector<std::uint32_t> links_;  // of the frames that the steps start from
};

}  // namespace clearance
