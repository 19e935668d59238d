#include <algorithm>

#include "engine/cuda/dense/depth_kernel.cuh"
#include "engine/cuda/dense/depths.cuh"

namespace clearance::cuda {

namespace {

// The number of pairs is not yet determined. More blocks than fit on a device at a time, since their times differ.
constexpr std::uint64_t kMostBlocks = 9600;

}  // namespace

void start_depths(ChunkView& view, std::uint64_t rows, cudaStream_t stream) {
  view.blocks = static_cast<std::uint32_t>(std::min(kMostBlocks, (rows + kDepthWarps - 1) / kDepthWarps));
  prove_depths<<<view.blocks, kDepthThreads, kDepthBytes, stream>>>(view);
}

}  // namespace clearance::cuda
