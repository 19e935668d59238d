// Factory of the workspaces of motions, whose kernels are compiled separately.
#pragma once

#include <memory>

#include "engine/cuda/workspace/workspace.cuh"

namespace clearance::cuda {

/// A pooled workspace.
class LentMotions : public MotionWorkspace {
 public:
  virtual void wait_for_all() = 0;
};

/// The calling thread's device must be that of the hulls.
std::unique_ptr<LentMotions> make_motions(const ResidentHulls& hulls, WorkCounters& counters);

}  // namespace clearance::cuda
