// Who makes the workspaces of motions, whose kernels are compiled by themselves.
#pragma once

#include <memory>

#include "engine/cuda/workspace/workspace.cuh"

namespace clearance::cuda {

/// One that a pool lends.
class LentMotions : public MotionWorkspace {
 public:
  virtual void wait_for_all() = 0;
};

/// On the calling thread's device, which is that of the hulls.
std::unique_ptr<LentMotions> make_motions(const ResidentHulls& hulls, WorkCounters& counters);

}  // namespace clearance::cuda
