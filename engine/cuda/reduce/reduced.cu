#include "engine/cuda/reduce/reduced.cuh"
#include "engine/cuda/reduce/reduced_workspace.cuh"
#include "engine/cuda/reduce/resident_reduced.cuh"

namespace clearance::cuda {

std::unique_ptr<LentReduced> make_reduced(const ResidentHulls& hulls, WorkCounters& counters) {
  return std::make_unique<ReducedCudaWorkspace>(hulls, counters);
}

std::unique_ptr<ResidentWorkspace> make_resident_reduced(const ResidentHulls& hulls, WorkCounters& counters) {
  return std::make_unique<ResidentReduced>(hulls, counters);
}

}  // namespace clearance::cuda
