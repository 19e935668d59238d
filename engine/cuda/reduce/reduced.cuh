// Factories of the workspaces of reduced queries. Their kernels are compiled separately, since nvcc takes minutes for
// all kernels.
#pragma once

#include <memory>

#include "engine/cuda/workspace/workspace.cuh"

namespace clearance::cuda {

/// A pooled workspace.
class LentReduced : public ReducedWorkspace {
 public:
  virtual void wait_for_all() = 0;
};

/// The calling thread's device must be that of the hulls.
std::unique_ptr<LentReduced> make_reduced(const ResidentHulls& hulls, WorkCounters& counters);
/// For Reduce::kMin and Reduce::kAny.
std::unique_ptr<ResidentWorkspace> make_resident_reduced(const ResidentHulls& hulls, WorkCounters& counters);

}  // namespace clearance::cuda
