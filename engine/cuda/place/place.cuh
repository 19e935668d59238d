// What starts the kernels that place bodies, which are compiled once for all workspaces.
#pragma once

#include <cuda_runtime.h>

#include "engine/device/layout.h"

namespace clearance::cuda {

/// Boxes of the bodies that stay, and of their pieces. \param boxes, outer null: only those of the pieces are wanted
void start_fixed_boxes(const HullsView& hulls, const BodiesView& bodies, double* boxes, OuterBox* outer,
                       cudaStream_t stream);
/// The frames of links, where joints of a robot move.
void start_links(const FramesView& frames, std::uint32_t configurations, cudaStream_t stream);
/// The bodies that move, where there are any.
void start_bodies(const HullsView& hulls, const BodiesView& bodies, const MovesView& moves,
                  std::uint32_t configurations, cudaStream_t stream);

}  // namespace clearance::cuda
