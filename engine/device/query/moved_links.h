// The robots whose joints a query moves, as kernels know them.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/device/device.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

/// Its arrays live as long as this.
class MovedLinks {
 public:
  explicit MovedLinks(const Plan& plan);
  /// Points a setup to the arrays.
  void tell(QuerySetup& setup) const;
  /// Of each body that joints place, in the order of Plan::bodies behind those that the query gives: its frame.
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
