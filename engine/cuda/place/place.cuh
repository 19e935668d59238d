// Launches of the kernels that place bodies. Compiled once for all workspaces.
#pragma once

#include <cuda_runtime.h>

#include "engine/device/layout.h"

namespace clearance::cuda {

/// Boxes of fixed bodies and of their convex parts.
/// \param boxes null together with `outer` if only the boxes of the parts are needed
void start_fixed_boxes(const HullsView& hulls, const BodiesView& bodies, double* boxes, OuterBox* outer,
                       cudaStream_t stream);
/// Link frames, if joints of a robot move.
void start_links(const FramesView& frames, std::uint32_t configurations, cudaStream_t stream);
/// Moved bodies, if any.
void start_bodies(const HullsView& hulls, const BodiesView& bodies, const MovesView& moves,
                  std::uint32_t configurations, cudaStream_t stream);

}  // namespace clearance::cuda
