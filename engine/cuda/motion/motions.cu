#include "engine/cuda/motion/motion_workspace.cuh"
#include "engine/cuda/motion/motions.cuh"

namespace clearance::cuda {

std::unique_ptr<LentMotions> make_motions(const ResidentHulls& hulls, WorkCounters& counters) {
  return std::make_unique<MotionCudaWorkspace>(hulls, counters);
}

}  // namespace clearance::cuda
