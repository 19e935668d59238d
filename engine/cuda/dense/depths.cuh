// Launch of the depth kernel. Compiled separately, since the other kernels take nvcc minutes.
#pragma once

#include <cuda_runtime.h>

#include "engine/device/layout.h"

namespace clearance::cuda {

/// Takes ChunkView::enclosed from earlier kernels of the stream. Must be the chunk's last kernel.
/// \param view receives `blocks`
void start_depths(ChunkView& view, std::uint64_t rows, cudaStream_t stream);

}  // namespace clearance::cuda
