// Unresolved pairs of reduced chunks, for queries without a CPU to answer them. Replaces take_answers() and
// take_open_answers(), with bounds proved on the device.
#pragma once

#include "engine/cuda/pair/open_pair.cuh"
#include "engine/cuda/reduce/any_kernel.cuh"

namespace clearance::cuda {

// \tparam kAny for Reduce::kAny, where each pair is evaluated only up to its margin
template <bool kAny>
__global__ void __launch_bounds__(kItemThreads)
    answer_open_items(const __grid_constant__ ReducedView r, std::uint32_t most_warps) {
  const ChunkView& c = r.chunk;
  const SpreadList list(c.counts[kAny ? kUnresolved : kRest], most_warps);
  for (std::uint32_t first = 0; first < list.count; first += list.step) {
    const std::uint32_t i = list.at(first);
    if (i >= list.count) continue;
    const std::uint32_t at = kAny ? r.unresolved[i] : c.rest[i];
    const Item item = listed_item(r, at);
    if (kAny && is_decided_before(r, item)) continue;
    const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
    PairLimits q = c.pair_limits;
    if (kAny) q.max_distance = margin_of(r, item.p);
    const PairAnswer answer = open_answer(c, q, item.ref, item.k, at_a, at_b);
    r.answers[at] = answer;
    if (kAny)
      offer_to_decision(r, item, at, answer);
    else
      offer(r, item, at, answer, at_a, at_b);
  }
}

}  // namespace clearance::cuda
