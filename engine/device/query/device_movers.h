// The joints that move a query's bodies, in the layout of kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/device/device.h"
#include "engine/evaluate/joint_gradient.h"

namespace clearance::cuda {

/// Its arrays live as long as this.
class DeviceMovers {
 public:
  DeviceMovers(const JointGradient& gradient, const Plan& plan);
  /// Views of the arrays.
  MoversSetup setup() const;

 private:
  std::vector<JointMover> movers_;
  std::vector<std::uint32_t> of_body_;
};

}  // namespace clearance::cuda
