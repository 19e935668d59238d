#include <algorithm>

#include "engine/cuda/dense/depth_kernel.cuh"
#include "engine/cuda/dense/depths.cuh"

namespace clearance::cuda {

namespace {

// How many pairs there are nobody knows yet. More blocks than a device holds at a time: they take unequal times.
constexpr std::uint64_t kMostBlocks = 9600;

}  // namespace

void start_depths(ChunkView& view, std::uint64_t rows, cudaStream_t stream) {
  view.blocks = static_cast<std::uint32_t>(std::min(kMostBlocks, (rows + kDepthWarps - 1) / kDepthWarps));
  prove_depths<<<view.blocks, kDepthThreads, kDepthBytes, stream>>>(view);
}

}  // namespace clearance::cuda
