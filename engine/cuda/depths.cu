#include <algorithm>

#include "engine/cuda/depth_kernel.cuh"
#include "engine/cuda/depths.cuh"

namespace clearance::cuda {

namespace {

// Few chunks have many depths, but these take longest of all: all that an H100 holds at a time.
constexpr std::uint64_t kMostBlocks = kDepthBlocksOfOne * 132;

}  // namespace

void start_depths(ChunkView& view, std::uint64_t rows, cudaStream_t stream) {
  view.blocks = static_cast<std::uint32_t>(std::min(kMostBlocks, (rows + kDepthWarps - 1) / kDepthWarps));
  prove_depths<<<view.blocks, kDepthThreads, kDepthBytes, stream>>>(view);
}

}  // namespace clearance::cuda
