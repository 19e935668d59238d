// Kernels of dense chunks: groups that share both hulls, in blocks of their own; ungrouped pairs; and pairs of several
// convex parts.
#pragma once

#include "engine/cuda/dense/overlap_rows.cuh"
#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/cuda/pair/part_kernel.cuh"

namespace clearance::cuda {

// A hull copied to a block's shared memory.
struct SharedHull {
  Hull<SharedVertices> hull;
  Hull<SharedFloats> hull_f32;
};
// \param begin byte offset in shared memory
template <class T>
__device__ inline SharedHull share(const HullsView& hulls, const HullHead* head, std::uint32_t begin) {
  const std::uint32_t blocks = (head->words + 7) / 8, count = head->count;
  const Shared<uint4> table{begin};
  const Shared<double2> xy{begin + blocks * 16};
  const Shared<double> z{xy.at + count * 16};
  const Shared<float4> f32{begin + shared_bytes(*head)};
  const auto* words = reinterpret_cast<const uint4*>(hulls.words + head->first_word);
  for (std::uint32_t i = threadIdx.x; i < blocks; i += blockDim.x) table[i] = words[i];
  for (std::uint32_t i = threadIdx.x; i < count; i += blockDim.x) {
    xy[i] = {hulls.x[head->first + i], hulls.y[head->first + i]};
    z[i] = hulls.z[head->first + i];
    if (kIsF32<T>) f32[i] = reinterpret_cast<const float4*>(hulls.f32)[head->first + i];
  }
  return {{{xy, z}, {begin}, head}, {{f32}, {begin}, head}};
}
// Both hulls of a block's group.
struct SharedPair {
  SharedHull a, b;
};
template <class T>
__device__ inline SharedPair share_pair(const ChunkView& c, const Group& group) {
  const HullHead *head_a = c.hulls.heads + group.hull_a, *head_b = c.hulls.heads + group.hull_b;
  const SharedHull a = share<T>(c.hulls, head_a, 0);
  if (group.hull_a == group.hull_b) return {a, a};
  return {a, share<T>(c.hulls, head_b, kIsF32<T> ? shared_bytes_f32(*head_a) : shared_bytes(*head_a))};
}
// Whether a group's pairs are first answered in T.
template <class T>
__device__ inline bool goes_first(const ChunkView& c, const HullHead& a, const HullHead& b) {
  return kIsF32<T> == (c.pair_limits.f32 && fit_f32(a, b));
}

// Answers an item and writes its row, if it converges.
template <bool kLean, class Hull, class PointHull, class S = NoSlack>
__device__ inline PairOutcome answer_item(const ChunkView& c, const GroupItem& item, const Hull& a, const Hull& b,
                                          const PairHulls<PointHull>& hulls, const PairFrame<typename Hull::T>& at,
                                          Enclosed& enclosed, const S& slack = S()) {
  enclosed.pair = item.pair;
  enclosed.configuration = item.k;
  PairAnswer answer;
  const PairOutcome outcome = solve_item<kLean>(c, a, b, hulls, item.at_a, item.at_b, at, answer, enclosed, slack);
  if (outcome == PairOutcome::kEnclosed && c.prove_at_once) return prove_row(c, enclosed);
  if (outcome == PairOutcome::kWithoutParts || outcome == PairOutcome::kConverged)
    write_answer<kLean>(c, item.row, item.k, item.at_a, item.at_b, answer);
  return outcome;
}

// Blocks of pairs that share both hulls, which are copied to shared memory. The float32 kernel takes the hulls that fit
// it, and lists unresolved pairs.
// \tparam T scalar of the iteration
template <class T>
__global__ void __launch_bounds__(kTile, kIsF32<T> ? kBlocksF32 : kBlocks)
    answer_groups(const __grid_constant__ ChunkView c) {
  note_begin(c);
  const Group group = c.group_of_tile[blockIdx.x];
  const HullHead *head_a = c.hulls.heads + group.hull_a, *head_b = c.hulls.heads + group.hull_b;
  if (!goes_first<T>(c, *head_a, *head_b)) return;  // handled by the other kernel
  const std::uint32_t place = (blockIdx.x - group.first_tile) * kTile + threadIdx.x,
                      count = group.count * c.configurations;
  const GroupItem item(c, group, place < count ? place : count - 1);
  // Poses are loaded while hulls are copied.
  const PairFrame<T> at = place_pair<T>(item.at_a, *head_a, item.at_b, *head_b);
  const auto [a, b] = share_pair<T>(c, group);
  __syncthreads();

  Enclosed enclosed;
  PairOutcome outcome = PairOutcome::kNone;
  const PairHulls<Hull<SharedVertices>> hulls{a.hull, b.hull};
  if (place < count) {
    if constexpr (kIsF32<T>)
      outcome = answer_item<false>(c, item, a.hull_f32, b.hull_f32, hulls, at, enclosed);
    else
      outcome = answer_item<false>(c, item, a.hull, b.hull, hulls, at, enclosed);
  }
  report<kIsF32<T>>(c, outcome, item.row, enclosed);
  hand_over_counts(c);
}

// One item, with hulls read from the scene's arrays.
// \tparam kBoth float32 is tried first where requested and possible
// \tparam S Slack, or NoSlack
template <bool kBoth, bool kLean, class S = NoSlack>
__device__ inline void answer_alone(const ChunkView& c, const GroupItem& item, bool is_there) {
  const HullHead *head_a = head_of(c, item.ref.a), *head_b = head_of(c, item.ref.b);
  const Hull<SceneVertices> a = scene_hull(c.hulls, head_a), b = scene_hull(c.hulls, head_b);
  const PairHulls<Hull<SceneVertices>> hulls{a, b};
  Enclosed enclosed;
  PairOutcome outcome = PairOutcome::kNone;
  const S slack = known_slack<S>(c, item.ref, item.k);
  if (is_there) {
    outcome = PairOutcome::kUnresolved;
    if (kBoth && fit_f32(*head_a, *head_b)) {
      const PairFrame<float> at = place_pair<float>(item.at_a, *head_a, item.at_b, *head_b);
      outcome = answer_item<kLean>(c, item, scene_hull_f32(c.hulls, head_a), scene_hull_f32(c.hulls, head_b), hulls, at,
                                   enclosed, slack);
    }
    if (outcome == PairOutcome::kUnresolved) {
      const PairFrame<double> at = place_pair<double>(item.at_a, *head_a, item.at_b, *head_b);
      outcome = answer_item<kLean>(c, item, a, b, hulls, at, enclosed, slack);
    }
  }
  report(c, outcome, item.row, enclosed);
}

// Pairs too few to fill a block of their own group; with uncertainty, all pairs of single convex parts.
// \param ungrouped their group
template <bool kBoth, bool kLean, class S = NoSlack>
__global__ void __launch_bounds__(kTile, kBlocks)
    answer_ungrouped(const __grid_constant__ ChunkView c, Group ungrouped) {
  note_begin(c);
  const std::uint32_t place = blockIdx.x * kTile + threadIdx.x, count = ungrouped.count * c.configurations;
  answer_alone<kBoth, kLean, S>(c, GroupItem(c, ungrouped, place < count ? place : count - 1), place < count);
  hand_over_counts(c);
}

// Pairs with a body of several convex parts.
// \param several their group
template <bool kBoth>
__global__ void __launch_bounds__(kTile, kBlocks) answer_several(const __grid_constant__ ChunkView c, Group several) {
  note_begin(c);
  const std::uint32_t place = blockIdx.x * kTile + threadIdx.x, count = several.count * c.configurations;
  const GroupItem item(c, several, place < count ? place : count - 1);
  PairOutcome outcome = PairOutcome::kNone;
  PairAnswer answer;
  if (place < count) outcome = solve_parts<kBoth>(c, c.pair_limits, item.ref, item.k, item.at_a, item.at_b, answer);
  if (outcome == PairOutcome::kWithoutParts || outcome == PairOutcome::kConverged)
    write_answer(c, item.row, item.k, item.at_a, item.at_b, answer);
  report(c, outcome, item.row, {});
  hand_over_counts(c);
}

// Answers pairs in float64 that float32 left open.
// \param most_warps at a time
template <bool kLean>
__global__ void __launch_bounds__(kTile, kBlocks)
    answer_open(const __grid_constant__ ChunkView c, std::uint32_t most_warps) {
  const SpreadList list(c.counts[kLeftOpen], most_warps);
  for (std::uint32_t first = 0; first < list.count; first += list.step) {
    const std::uint32_t i = list.at(first);
    const LeftOpen open = c.left_open[i < list.count ? i : list.count - 1];
    answer_alone<false, kLean>(c, GroupItem(c, open.pair, open.configuration), i < list.count);
  }
  hand_over_counts(c);
}

}  // namespace clearance::cuda
