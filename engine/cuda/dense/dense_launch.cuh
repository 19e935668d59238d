// Launches the kernels of a dense chunk, one after another in a stream.
#pragma once

#include <algorithm>

#include "engine/cuda/dense/depths.cuh"
#include "engine/cuda/dense/group_kernel.cuh"
#include "engine/cuda/dense/lean_kernel.cuh"
#include "engine/cuda/dense/overlap_rows.cuh"
#include "engine/cuda/workspace/resident.cuh"

namespace clearance::cuda {

// Grid of the kernels of pairs that float32 leaves open and of overlapping pairs. These take long, and their number is
// unknown when their kernels start.
struct LateGrid {
  std::uint32_t blocks;
  std::uint32_t warps;  // over which many pairs are spread

  // Few blocks, which leave the others to the next chunk's kernels.
  static LateGrid among_chunks() { return {66, 64}; }
  // The whole device, for chunks that follow each other in one stream.
  static LateGrid whole_device() {
    const std::uint32_t blocks = blocks_for_device(2);
    return {blocks, blocks};
  }
};

inline bool f32_goes_first(const PairLimits& pair_limits, const ChunkSetup& chunk, const CudaPairs& pairs) {
  return pair_limits.f32 && chunk.group_tiles > 0 && pairs.most_shared_f32 > 0;
}

// The kernel for pairs that share both hulls.
// \param points whether rows have points
template <class T, bool kLean>
auto group_kernel(bool points) {
  if constexpr (kLean)
    return points ? answer_lean<T, true> : answer_lean<T, false>;
  else
    return answer_groups<T>;
}

// The last kernel hands over the counts.
template <bool kLean>
void answer_chunk_as(ChunkView& view, const ChunkSetup& chunk, const CudaPairs& pairs, const LateGrid& late,
                     cudaStream_t stream) {
  view.group_of_tile = pairs.group_of_tile + chunk.first_tile;
  const bool f32 = view.pair_limits.f32;
  const bool f32_first = f32_goes_first(view.pair_limits, chunk, pairs), only_f32 = f32_first && pairs.all_fit_f32;
  const bool proof_follows = view.enclosed && (chunk.ungrouped_tiles > 0 || (chunk.group_tiles > 0 && !only_f32));
  ChunkView before = view;  // for a kernel with a successor
  before.host_counts = nullptr;
  view.blocks = chunk.tiles();
  const ChunkView& first = f32_first || proof_follows ? before : view;
  const bool points = view.pair_limits.want_points;
  if (f32_first) {
    const auto kernel = group_kernel<float, kLean>(points);
    kernel<<<chunk.group_tiles, kTile, pairs.most_shared_f32, stream>>>(first);
  }
  if (chunk.group_tiles > 0 && !only_f32) {
    const auto kernel = group_kernel<double, kLean>(points);
    kernel<<<chunk.group_tiles, kTile, pairs.most_shared, stream>>>(first);
  }
  if (chunk.ungrouped_tiles > 0) {
    const auto kernel = f32 ? answer_ungrouped<true, kLean> : answer_ungrouped<false, kLean>;
    kernel<<<chunk.ungrouped_tiles, kTile, 0, stream>>>(first, chunk.ungrouped);
  }
  if (chunk.several_tiles > 0) {
    const auto kernel = f32 ? answer_several<true> : answer_several<false>;
    kernel<<<chunk.several_tiles, kTile, 0, stream>>>(first, chunk.several);
  }
  if (f32_first) {
    ChunkView open = proof_follows ? before : view;
    open.prove_at_once = view.pair_limits.prove_overlaps;
    open.blocks = std::min(chunk.group_tiles, late.blocks);
    answer_open<kLean><<<open.blocks, kTile, 0, stream>>>(open, late.warps);
  }
  if (proof_follows && view.pair_limits.prove_depths) {
    start_depths(view, chunk.rows(), stream);
  } else if (proof_follows) {
    view.blocks = std::min(blocks_of(chunk.rows(), kTile), late.blocks);
    prove_overlaps<<<view.blocks, kTile, 0, stream>>>(view, late.warps);
  }
}

// The same if a body is uncertain: one list of all pairs of single convex parts, whose hulls are read from the scene's
// arrays. Overlaps are proved by the thread that finds them.
inline void answer_uncertain_chunk(ChunkView& view, const ChunkSetup& chunk, cudaStream_t stream) {
  const Group singles{kNone, kNone, 0, chunk.ungrouped.first + chunk.ungrouped.count, 0};
  const std::uint32_t tiles = blocks_of(std::uint64_t{singles.count} * chunk.configurations, kTile);
  const bool f32 = view.pair_limits.f32;
  view.prove_at_once = view.pair_limits.prove_overlaps;
  view.blocks = tiles + chunk.several_tiles;
  if (tiles > 0) {
    const auto kernel = f32 ? answer_ungrouped<true, false, Slack> : answer_ungrouped<false, false, Slack>;
    kernel<<<tiles, kTile, 0, stream>>>(view, singles);
  }
  if (chunk.several_tiles > 0) {
    const auto kernel = f32 ? answer_several<true> : answer_several<false>;
    kernel<<<chunk.several_tiles, kTile, 0, stream>>>(view, chunk.several);
  }
}

// \param fields requested columns, Field bits
inline void answer_chunk(ChunkView& view, const ChunkSetup& chunk, const CudaPairs& pairs, std::uint32_t fields,
                         const LateGrid& late, cudaStream_t stream) {
  const bool lean = (fields & ~kLeanFields) == 0;
  if (view.bodies.uncertainties.fixed)
    answer_uncertain_chunk(view, chunk, stream);
  else
    lean ? answer_chunk_as<true>(view, chunk, pairs, late, stream)
         : answer_chunk_as<false>(view, chunk, pairs, late, stream);
  check(cudaGetLastError(), "starting a kernel");
}

}  // namespace clearance::cuda
