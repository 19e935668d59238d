// Reduce::kAny: whether every pair is farther apart than its margin. A configuration is decided as by
// Reduction::decision(): by the first pair within its margin; else by the first pair proved neither beyond nor within
// it; else by the first without usable poses; else by all pairs together. Rows have the same bits as there.
//
// Boxes exclude pairs beyond their margins. The other pairs are evaluated in no order, and atomicMin(), which is
// order-independent, finds the first of each kind: ReducedView::winner, `lowest` and `unusable`. A pair after one
// within its margin changes nothing, and is skipped if that is known in time. near_hulls.cuh evaluates most
// of them.
#pragma once

#include "engine/cuda/pair/margin_pair.cuh"
#include "engine/cuda/reduce/near_hulls.cuh"

namespace clearance::cuda {

// Lists the pairs whose boxes are within their margins, and finds pairs without usable poses.
__global__ void __launch_bounds__(kScanThreads) find_near_pairs(const __grid_constant__ ReducedView r) {
  list_by_boxes(r, [&](const Item& item, const OuterBox& a, const OuterBox& b) {
    const bool usable = !is_empty(a) && !is_empty(b);
    if (!usable) take_least(r.unusable + item.k, item.p);
    return usable && !(gap_below(a, b) > margin_of(r, item.p));
  });
}

// Evaluates the pairs of hulls that evaluate_near_hulls() leaves, up to their margins. Pairs of PairKind::kLeft become
// unresolved, and those of the other kinds have kernels of their own (element_kernel.cuh).
template <class S>
__global__ void __launch_bounds__(kItemThreads) evaluate_near_pairs(const __grid_constant__ ReducedView r) {
  const ChunkView& c = r.chunk;
  const std::uint32_t count = c.counts[kLaterItems];
  for (std::uint32_t first = blockIdx.x * kItemThreads; first < count; first += gridDim.x * kItemThreads) {
    const std::uint32_t at = first + threadIdx.x, i = at < count ? r.later[at] : 0;
    PairOutcome outcome = PairOutcome::kNone;
    const PairKind kind = at < count ? kind_of(r, Item(r, r.items[i])) : PairKind::kMeshes;
    if ((kind == PairKind::kHulls || kind == PairKind::kLeft) && !is_decided_before(r, Item(r, r.items[i]))) {
      const Item item(r, r.items[i]);
      const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
      PairLimits q = c.pair_limits;
      q.max_distance = margin_of(r, item.p);
      PairAnswer answer;
      outcome = kind == PairKind::kLeft
                    ? PairOutcome::kUnresolved
                    : evaluate_at_margin<S>(c, q, q.max_distance, item.ref, item.k, at_a, at_b, answer);
      if (outcome == PairOutcome::kUnresolved) {
        list_unresolved(r, i);
      } else {
        r.answers[i] = answer;
        offer_to_decision(r, item, i, answer);
      }
    }
    add_count(c.counts + kConvergedRows, outcome == PairOutcome::kConverged);
  }
}

// Lists unresolved pairs for the CPU, unless an earlier pair has decided.
__global__ void __launch_bounds__(kItemThreads) list_open_pairs(const __grid_constant__ ReducedView r) {
  const std::uint32_t count = r.chunk.counts[kUnresolved];
  for (std::uint32_t first = blockIdx.x * kItemThreads; first < count; first += gridDim.x * kItemThreads) {
    const std::uint32_t at = first + threadIdx.x, i = at < count ? r.unresolved[at] : 0;
    const bool is_open = at < count && !is_decided_before(r, Item(r, r.items[i]));
    const std::uint32_t rest = take_place(r.chunk.counts + kRest, is_open);
    if (!is_open) continue;
    r.chunk.rest[rest] = i;
    r.rest_rows[rest] = r.items[i];
  }
}

// Stores the CPU's answers, in the order of chunk.rest.
__global__ void __launch_bounds__(kItemThreads)
    take_open_answers(const __grid_constant__ ReducedView r, const PairAnswer* answers, std::uint32_t count) {
  const std::uint32_t i = blockIdx.x * kItemThreads + threadIdx.x;
  if (i >= count) return;
  const std::uint32_t at = r.chunk.rest[i];
  const PairAnswer answer = answers[i];
  r.answers[at] = answer;
  offer_to_decision(r, Item(r, r.items[at]), at, answer);
}

// Writes the row of the pair that decides its configuration.
__device__ inline void write_decision(const ReducedView& r, std::uint32_t k, std::uint64_t key, bool within) {
  const ChunkView& c = r.chunk;
  const PairRef ref = c.pairs[key >> 32];
  const auto [at_a, at_b] = poses_of(c, ref, k);
  PairAnswer answer = r.answers[static_cast<std::uint32_t>(key)];
  answer.status = within ? decided_status(answer.lower, answer.upper) : Status::kUnconverged;
  if (r.unusable[k] != kNoPair) answer.flags |= kFlagIncomplete;
  write_answer(c, k, k, at_a, at_b, answer);
}

// Writes a row per configuration.
__global__ void __launch_bounds__(kItemThreads) write_decisions(const __grid_constant__ ReducedView r) {
  pass_counts(r);
  const std::uint32_t k = blockIdx.x * kItemThreads + threadIdx.x;
  constexpr std::uint64_t kNone64 = ~std::uint64_t{0};
  if (k >= r.chunk.configurations) return;
  if (r.winner[k] != kNone64) return write_decision(r, k, r.winner[k], true);
  if (r.lowest[k] != kNone64) return write_decision(r, k, r.lowest[k], false);
  if (r.unusable[k] != kNoPair) return write_unusable(r, k, r.chunk.pairs[r.unusable[k]]);
  write_no_pair(r.chunk, k, k, {kNone, kNone}, r.beyond);
}

}  // namespace clearance::cuda
