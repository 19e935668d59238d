// The robots whose joints a query moves, in the layout of kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/device/device.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

/// Owns the arrays that kernels get.
class MovedLinks {
 public:
  explicit MovedLinks(const Plan& plan);
  /// Views of the arrays.
  RobotsSetup setup() const;
  /// Frame of each body placed by joints, in the order of Plan::bodies after the given ones.
  const std::vector<std::uint32_t>& frames() const { return frames_; }

 private:
  void add(const LinkMotion& motion);

  std::vector<KinematicStep> steps_;
  std::vector<JointColumn> columns_;
  std::vector<JointRobot> robots_;
  std::vector<std::uint32_t> frames_;
  std::uint32_t frame_count_ = 0, joints_;
};

}  // namespace clearance::cuda
