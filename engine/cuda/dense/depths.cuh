// What starts the kernel of depths, which is compiled by itself: nvcc takes minutes for the others.
#pragma once

#include <cuda_runtime.h>

#include "engine/device/layout.h"

namespace clearance::cuda {

/// Takes ChunkView::enclosed from the kernels before it in the stream; the last kernel of its chunk.
/// \param view `blocks` is set
void start_depths(ChunkView& view, std::uint64_t rows, cudaStream_t stream);

}  // namespace clearance::cuda
