// Who makes the workspaces of reduced queries, whose kernels are compiled by themselves: nvcc takes minutes for all.
#pragma once

#include <memory>

#include "engine/cuda/workspace/workspace.cuh"

namespace clearance::cuda {

/// One that a pool lends.
class LentReduced : public ReducedWorkspace {
 public:
  virtual void wait_for_all() = 0;
};

/// On the calling thread's device, which is that of the hulls.
std::unique_ptr<LentReduced> make_reduced(const ResidentHulls& hulls, WorkCounters& counters);
/// Of Reduce::kMin and Reduce::kAny.
std::unique_ptr<StandingWorkspace> make_standing_reduced(const ResidentHulls& hulls, WorkCounters& counters);

}  // namespace clearance::cuda
