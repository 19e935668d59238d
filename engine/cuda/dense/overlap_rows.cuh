// Enclosed pairs of dense chunks: proved overlaps get their rows, the other pairs are left to the CPU.
#pragma once

#include "engine/cuda/pair/overlap_kernel.cuh"

namespace clearance::cuda {

__device__ inline std::uint64_t row_of(const ChunkView& c, const Enclosed& e) {
  return std::uint64_t{e.configuration} * c.pair_count + c.position[e.pair];
}
// Outcome of a pair, with its row written if proved. Not inlined, so that it takes no registers from the iteration.
__device__ __noinline__ inline PairOutcome prove_row(const ChunkView& c, Enclosed e) {
  const PairRef pair = c.pairs[e.pair];
  const auto [at_a, at_b] = poses_of(c, pair, e.configuration);
  PairAnswer answer;
  answer.flags = flags_of(at_a, at_b);
  const PairOutcome outcome = proved(c, e, at_a, at_b, slack_of_pair(c, pair, e.configuration).outer, answer);
  if (outcome == PairOutcome::kConverged) write_answer(c, row_of(c, e), e.configuration, at_a, at_b, answer);
  return outcome;
}

__global__ void __launch_bounds__(kTile) prove_overlaps(const __grid_constant__ ChunkView c, std::uint32_t most_warps) {
  const std::uint32_t count = c.counts[kEnclosedPairs];
  const SpreadList list(count, most_warps);
  for (std::uint32_t first = 0; first < count; first += list.step) {
    const std::uint32_t i = list.at(first);
    PairOutcome outcome = PairOutcome::kNone;
    std::uint64_t row = 0;
    if (i < count) {
      const Enclosed e = c.enclosed[i];
      row = row_of(c, e);
      outcome = prove_row(c, e);
    }
    const std::uint32_t rest = take_place(c.counts + kRest, outcome == PairOutcome::kUnresolved);
    if (outcome == PairOutcome::kUnresolved) c.rest[rest] = static_cast<std::uint32_t>(row);
    add_count(c.counts + kConvergedRows, outcome == PairOutcome::kConverged);
  }
  hand_over_counts(c);
}

}  // namespace clearance::cuda
