// Places bodies from the poses of configurations: one thread per body and configuration.
#pragma once

#include "engine/cuda/place/link_kernel.cuh"
#include "engine/cuda/place/place_body.cuh"

namespace clearance::cuda {

// Boxes of fixed bodies at the snapshot's poses, and of their convex parts. Bodies that are not on the device get none.
// \param boxes null together with `outer_boxes` if only the boxes of the parts are needed
__global__ void __launch_bounds__(128)
    box_fixed_bodies(HullsView hulls, BodiesView bodies, double* boxes, OuterBox* outer_boxes) {
  const std::uint32_t body = blockIdx.x * blockDim.x + threadIdx.x, n = bodies.bodies;
  if (body >= n) return;
  if (outer_boxes) outer_boxes[body] = no_outer_box();
  if (!has_box(hulls, body) || static_cast<Status>(bodies.fixed_state[body] & kStateStatus) != Status::kOk) return;
  const auto at = [&](std::uint32_t c) {
    const double* p = bodies.fixed + std::size_t{c} * n + body;
    return Vec3d{p[0], p[n], p[2 * std::size_t{n}]};
  };
  const double inner = bodies.uncertainties.fixed ? bodies.uncertainties.fixed[body].all.inner : 0;
  const auto put = [&](std::uint32_t i, const Aabb& of_part) {
    if (!bodies.fixed_part_box) return;
    double* p = bodies.fixed_part_box + std::size_t{hulls.part_begin[body] + i} * 6;
    for (int k = 0; k < 3; ++k) {
      p[k] = of_part.low[k];
      p[3 + k] = of_part.high[k];
    }
  };
  const Aabb box = box_of_body(hulls, body, {{at(0), at(3), at(6)}}, at(9), inner, put);
  if (!outer_boxes) return;
  for (int i = 0; i < 3; ++i) {
    boxes[static_cast<std::size_t>(i) * n + body] = box.low[i];
    boxes[static_cast<std::size_t>(3 + i) * n + body] = box.high[i];
  }
  outer_boxes[body] = outer_box(box);
}

// Blocks on a multiprocessor, which share its registers; more spill (docs/notes/cuda.md).
inline constexpr int kPlaceBlocks = 4;

// Places the moved bodies that the query reads.
// \tparam kUncertain whether any body is uncertain
template <bool kUncertain>
__global__ void __launch_bounds__(128, kPlaceBlocks)
    place_bodies(HullsView hulls, BodiesView bodies, MovesView moves, std::uint32_t configurations) {
  const std::uint64_t item = std::uint64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  const auto at = static_cast<std::uint32_t>(item / configurations),
             k = static_cast<std::uint32_t>(item % configurations);
  if (at < moves.placed_count) place_body<kUncertain>(hulls, bodies, moves, moves.placed[at], k, configurations);
}

}  // namespace clearance::cuda
