// Unresolved rows of dense chunks, for queries without a CPU to finish them.
#pragma once

#include "engine/cuda/pair/open_pair.cuh"

namespace clearance::cuda {

// \param in_order the chunk's pairs in row order
__global__ void __launch_bounds__(kTile)
    answer_open_rows(const __grid_constant__ ChunkView c, const PairRef* in_order, std::uint32_t most_warps) {
  const SpreadList list(c.counts[kRest], most_warps);
  for (std::uint32_t first = 0; first < list.count; first += list.step) {
    const std::uint32_t i = list.at(first);
    if (i >= list.count) continue;
    const std::uint32_t row = c.rest[i], k = row / c.pair_count;
    const PairRef ref = in_order[row % c.pair_count];
    const auto [at_a, at_b] = poses_of(c, ref, k);
    write_answer(c, row, k, at_a, at_b, open_answer(c, c.pair_limits, ref, k, at_a, at_b));
  }
}

}  // namespace clearance::cuda
