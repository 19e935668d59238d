// Winding number of a solid's triangles around a point, counted by a warp: equals winding_number() if float64 decides
// every sign.
#pragma once

#include "engine/bvh/crossing.h"
#include "engine/cuda/mesh/element_set.cuh"

namespace clearance::cuda {

struct Winding {
  int number;
  bool is_sure;
};

// All threads of the warp call it.
// \param p in the solid's axes, as in winding_number()
// \param stack in shared memory, of `entries` nodes
__device__ inline Winding count_winding(const ElementSet& set, const Vec3d& p, std::uint32_t* stack,
                                        std::uint32_t entries) {
  const std::uint32_t lane = threadIdx.x % 32;
  const Vec3d from_centre = p - set.centre, point = flushed(p);
  int sum = 0;
  bool is_sure = true;
  const auto oriented = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    double permanent;
    const int sign = orientation_in_float64(a, b, c, d, permanent);
    is_sure = is_sure && sign != kUnsure;
    return sign;
  };
  __syncwarp();
  if (lane == 0) stack[0] = 0;
  std::uint32_t stacked = 1;
  while (stacked > 0) {
    __syncwarp();
    const std::uint32_t count = stacked < 32 ? stacked : 32;
    stacked -= count;
    const bool there = lane < count;
    const std::uint32_t at = there ? stack[stacked + lane] : 0;
    __syncwarp();
    const LoadedBox node(set, at);
    const bool meets = there && !ray_misses(node.low, node.high, from_centre), divides = meets && !node.is_leaf();
    if (meets && node.is_leaf())
      for (std::uint32_t i = node.begin(); i < node.begin() + node.count(); ++i) {
        const PartVertices corners = Triangles::corners(set, i);
        sum += crossing(flushed(corners[0]), flushed(corners[1]), flushed(corners[2]), point, oriented);
      }
    const std::uint32_t all = __ballot_sync(~0u, divides), more = 2 * static_cast<std::uint32_t>(__popc(all));
    if (stacked + more > entries) return {0, false};
    if (divides) {
      const std::uint32_t to = stacked + 2 * static_cast<std::uint32_t>(__popc(all & ((1u << lane) - 1)));
      stack[to] = node.right;
      stack[to + 1] = at + 1;
    }
    stacked += more;
  }
  for (int step = 16; step > 0; step /= 2) sum += __shfl_xor_sync(~0u, sum, step);
  return {sum, __all_sync(~0u, is_sure) != 0};
}

}  // namespace clearance::cuda
