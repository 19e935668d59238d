// Pairs that share both hulls, for queries that need only bounds or float32 columns: the blocks of group_kernel.cuh
// reduced to iteration and certification. Overlapping and unresolved pairs are listed for later kernels.
#pragma once

#include "engine/cuda/dense/group_kernel.cuh"

namespace clearance::cuda {

// Blocks of kTile threads per multiprocessor, as kBlocks. This number spills some poses in float64, and nothing inside
// the loop in float32 (docs/notes/cuda.md).
inline constexpr int kLeanBlocks = 4;

// A thread's item in a tile of a group. Its bodies are looked up when needed, and again when its row is written, since
// registers are scarce in between.
struct LeanItem {
  std::uint32_t pair, k, row;

  __device__ LeanItem(const ChunkView& c, const Group& group, std::uint32_t item) {
    const std::uint32_t before = c.configurations == 1 ? item : item / c.configurations;
    pair = group.first + before;
    k = item - before * c.configurations;
    row = k * c.pair_count + c.position[pair];
  }
};

// Writes the row of an answer, with its points if kPoints.
template <bool kPoints>
__device__ inline void write_lean(const ChunkView& c, const LeanItem& item, const PairAnswer& answer) {
  write_interval(c.reply, item.row, answer);
  if (c.reply.configuration)
    c.reply.configuration[item.row] = static_cast<std::uint32_t>(c.first_configuration + item.k);
  if (c.reply.pair) {
    const PairRef ref = c.pairs[item.pair];
    c.reply.pair[item.row] = {body_of(c.bodies, ref.a), body_of(c.bodies, ref.b)};
  }
  if (kPoints && c.reply.points32) write_points32(c.reply.points32, item.row, answer);
}

// \tparam Hull of the iteration
// \tparam PointHull in float64
template <bool kPoints, class Hull, class PointHull>
__device__ inline PairOutcome answer_lean_item(const ChunkView& c, const LeanItem& item, const Hull& a, const Hull& b,
                                               const PairHulls<PointHull>& hulls, const PairRef& ref,
                                               std::uint8_t states, const PairFrame<typename Hull::T>& at,
                                               Enclosed& enclosed) {
  using T = typename Hull::T;
  PairAnswer answer;
  answer.point_a = answer.point_b = no_point();
  const PairLimits& q = c.pair_limits;
  PairOutcome outcome = PairOutcome::kWithoutParts;
  const bool looks = (states & kStateStatus) != static_cast<std::uint8_t>(Status::kOk) || q.cull;
  if (!looks || !answer_without_parts(q, BodyPoseRef(c.bodies, c.configurations, ref.a, item.k),
                                      BodyPoseRef(c.bodies, c.configurations, ref.b, item.k), answer)) {
    const auto take = [&](const Gjk<T>& g, const RunBounds<T>& bounds) {
      decide_apart(q.max_distance, bounds.lower, bounds.upper, true, answer);
      if (!kPoints || answer.status == Status::kBeyond) return;
      const Mat3d R_wa = BodyPoseRef(c.bodies, c.configurations, ref.a, item.k).frame().R_wb,
                  R_wb = BodyPoseRef(c.bodies, c.configurations, ref.b, item.k).frame().R_wb;
      converged_points(hulls.a, R_wa, hulls.b, R_wb, witness_of(g, bounds, R_wa), answer.point_a, answer.point_b);
    };
    outcome = run_to_end(q, a, b, at, enclosed, take);
  }
  if (outcome == PairOutcome::kWithoutParts || outcome == PairOutcome::kConverged) write_lean<kPoints>(c, item, answer);
  return outcome;
}

template <class T, bool kPoints>
__global__ void __launch_bounds__(kTile, kLeanBlocks) answer_lean(const __grid_constant__ ChunkView c) {
  note_begin(c);
  const Group group = c.group_of_tile[blockIdx.x];
  const HullHead *head_a = c.hulls.heads + group.hull_a, *head_b = c.hulls.heads + group.hull_b;
  if (!goes_first<T>(c, *head_a, *head_b)) return;  // handled by the other kernel
  const std::uint32_t place = (blockIdx.x - group.first_tile) * kTile + threadIdx.x,
                      count = group.count * c.configurations;
  const LeanItem item(c, group, place < count ? place : count - 1);
  const PairRef ref = c.pairs[item.pair];
  const auto [at_a, at_b] = poses_of(c, ref, item.k);
  // Poses are loaded while hulls are copied.
  const PairFrame<T> at = place_pair<T>(at_a, *head_a, at_b, *head_b);
  const auto [a, b] = share_pair<T>(c, group);
  __syncthreads();

  Enclosed enclosed;
  enclosed.pair = item.pair;
  enclosed.configuration = item.k;
  PairOutcome outcome = PairOutcome::kNone;
  if (place < count) {
    const PairHulls<Hull<SharedVertices>> hulls{a.hull, b.hull};
    const std::uint8_t states = at_a.state | at_b.state;
    if constexpr (kIsF32<T>)
      outcome = answer_lean_item<kPoints>(c, item, a.hull_f32, b.hull_f32, hulls, ref, states, at, enclosed);
    else
      outcome = answer_lean_item<kPoints>(c, item, a.hull, b.hull, hulls, ref, states, at, enclosed);
    if (outcome == PairOutcome::kEnclosed && c.prove_at_once) outcome = prove_row(c, enclosed);
  }
  report<kIsF32<T>>(c, outcome, item.row, enclosed);
  hand_over_counts(c);
}

}  // namespace clearance::cuda
