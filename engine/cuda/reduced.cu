#include "engine/cuda/reduced.cuh"
#include "engine/cuda/reduced_workspace.cuh"
#include "engine/cuda/standing_reduced.cuh"

namespace clearance::cuda {

std::unique_ptr<LentReduced> make_reduced(const ResidentHulls& hulls, WorkCounters& counters) {
  return std::make_unique<ReducedCudaWorkspace>(hulls, counters);
}

std::unique_ptr<StandingWorkspace> make_standing_reduced(const ResidentHulls& hulls, WorkCounters& counters) {
  return std::make_unique<StandingReduced>(hulls, counters);
}

}  // namespace clearance::cuda
