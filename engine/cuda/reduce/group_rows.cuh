// Rows of reduced queries: one per group, or one per pair within the distance.
#pragma once

#include "engine/cuda/pair/items.cuh"
#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/cuda/pair/slack.cuh"
#include "engine/narrow/group.h"

namespace clearance::cuda {

// Words of Reduce::kWithin: a bit per row or, for a whole table, per list position.
__host__ __device__ inline std::uint32_t hit_word_count(const ReducedView& r) {
  return ((r.keys ? r.capacity : r.rows) + 31) / 32;
}

// Whether the pair with the least lower bound of each group is needed: for its slack, or because the query requests it.
__device__ inline bool wants_lowest(const ReducedView& r) {
  return has_uncertainties(r.chunk) || r.chunk.reply.pair_lower;
}

__device__ inline void pass_counts(const ReducedView& r) {
  if (blockIdx.x == 0 && threadIdx.x < kCounts && threadIdx.x != kHits)
    r.chunk.host_counts[threadIdx.x] = r.chunk.counts[threadIdx.x];
}

// Rows of groups.
// \param at of the group, in the chunk
__device__ inline void write_empty(const ReducedView& r, std::uint64_t at) {
  const auto k = static_cast<std::uint32_t>(at / r.groups), group = static_cast<std::uint32_t>(at % r.groups);
  const BodyPair pair{r.reduce == Reduce::kNearest ? group : kNone, kNone};
  write_no_pair(r.chunk, at, k, pair, empty_answer());
}
// \param ref the group's first pair without usable poses
__device__ inline void write_unusable(const ReducedView& r, std::uint64_t at, PairRef ref) {
  const ChunkView& c = r.chunk;
  const auto k = static_cast<std::uint32_t>(at / r.groups);
  const auto [at_a, at_b] = poses_of(c, ref, k);
  PairAnswer answer = no_answer(pair_status(at_a.status(), at_b.status()));
  answer.flags = flags_of(at_a, at_b) | kFlagIncomplete;
  write_answer(c, at, k, at_a, at_b, answer);
}
// Reduction::rows() in the same order. A pair without usable poses may be nearer than all others, so only a proved
// overlap is the least distance in spite of it.
// \param lower least lower bound of the group
// \param unusable its first pair without usable poses, or kNoPair
// \param lowest the pair with the least lower bound, if needed
__device__ inline void write_group(const ReducedView& r, std::uint64_t at, PairRef ref, PairAnswer answer, double lower,
                                   std::uint32_t unusable, PairRef lowest) {
  if (unusable != kNoPair && !(answer.upper <= 0)) return write_unusable(r, at, r.chunk.pairs[unusable]);
  const ChunkView& c = r.chunk;
  const auto k = static_cast<std::uint32_t>(at / r.groups);
  const auto [at_a, at_b] = poses_of(c, ref, k);
  const PairLimits& q = c.pair_limits;
  if (has_uncertainties(c))
    widen_to_group(answer, lower, q.max_distance, q.abs_tol, q.rel_tol, pair_slack(c, ref, k),
                   pair_slack(c, lowest, k));
  else
    widen_to_group(answer, lower, q.max_distance, q.abs_tol, q.rel_tol);
  if (unusable != kNoPair) {
    answer.flags |= kFlagIncomplete;
    if (!q.prove_overlaps) answer.lower = -__builtin_inf(), lowest = c.pairs[unusable];  // the depth may be greater
  }
  write_answer(c, at, k, at_a, at_b, answer);
  if (c.reply.pair_lower) c.reply.pair_lower[at] = {body_of(c.bodies, lowest.a), body_of(c.bodies, lowest.b)};
}

// Writes a row per group.
__global__ void __launch_bounds__(kItemThreads) write_groups(const __grid_constant__ ReducedView r) {
  pass_counts(r);
  const std::uint64_t at = std::uint64_t{blockIdx.x} * kItemThreads + threadIdx.x;
  if (at >= std::uint64_t{r.chunk.configurations} * r.groups || (r.answered && r.answered[at])) return;
  const std::uint64_t seed = r.seed[at], winner = r.winner[at];
  if (r.answered && winner == ~std::uint64_t{0}) return;  // the CPU answers all of the group
  if (seed == ~std::uint64_t{0}) return write_empty(r, at);
  const std::uint32_t unusable = r.unusable[at];
  if (winner == ~std::uint64_t{0})  // without an unusable pair, the CPU's answer follows
    return write_unusable(r, at, r.chunk.pairs[unusable != kNoPair ? unusable : static_cast<std::uint32_t>(seed)]);
  const auto i = static_cast<std::uint32_t>(winner);
  const PairRef ref = r.chunk.pairs[winner >> 32];
  write_group(r, at, ref, r.answers[i], from_order_key(r.lower[at]), unusable,
              wants_lowest(r) ? r.chunk.pairs[r.lowest[at] >> 32] : ref);
}

__device__ inline std::uint32_t hits_before(const ReducedView& r, std::uint32_t word) {
  if (r.hit_ranks) return r.hit_ranks[word];
  std::uint32_t sum = 0;
#pragma unroll 8
  for (std::uint32_t i = 0; i < word; ++i) sum += __popc(r.hit_words[i]);
  return sum;
}

// Writes a row for each pair that is not beyond, in order.
__global__ void __launch_bounds__(kItemThreads) write_hits(const __grid_constant__ ReducedView r) {
  pass_counts(r);
  const ChunkView& c = r.chunk;
  if (blockIdx.x == 0 && threadIdx.x == 0) {
    const std::uint32_t last = hit_word_count(r) - 1;
    r.chunk.host_counts[kHits] = hits_before(r, last) + __popc(r.hit_words[last]);
  }
  const std::uint32_t count = item_count(r);
  for (std::uint32_t i = blockIdx.x * kItemThreads + threadIdx.x; i < count; i += gridDim.x * kItemThreads) {
    const std::uint32_t place = listed_bit(r, i), word = r.hit_words[place / 32], bit = 1u << place % 32;
    if (!(word & bit)) continue;
    const std::uint64_t at = hits_before(r, place / 32) + __popc(word & (bit - 1));
    if (at >= r.reply_rows) continue;
    const Item item = listed_item(r, i);
    const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
    write_answer(c, at, item.k, at_a, at_b, r.answers[i]);
  }
}

}  // namespace clearance::cuda
