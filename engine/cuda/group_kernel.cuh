// Dense chunks: pairs of the same two hulls in blocks of their own, and pairs without company.
#pragma once

#include "overlap_kernel.cuh"
#include "pair_kernel.cuh"

namespace clearance::cuda {

// A hull copied to a block's shared memory.
__device__ inline Hull<SharedVertices> share(const HullsView& hulls, const HullHead* head, std::byte* memory) {
  const std::uint32_t blocks = (head->words + 7) / 8, count = head->count;
  auto* table = reinterpret_cast<uint4*>(memory);
  auto* xy = reinterpret_cast<double2*>(table + blocks);
  auto* z = reinterpret_cast<double*>(xy + count);
  const auto* words = reinterpret_cast<const uint4*>(hulls.words + head->first_word);
  for (std::uint32_t i = threadIdx.x; i < blocks; i += blockDim.x) table[i] = words[i];
  for (std::uint32_t i = threadIdx.x; i < count; i += blockDim.x) {
    xy[i] = {hulls.x[head->first + i], hulls.y[head->first + i]};
    z[i] = hulls.z[head->first + i];
  }
  return {{xy, z}, reinterpret_cast<const std::uint16_t*>(table), head};
}

// An item of a group: a pair in a configuration, and where its bodies are.
struct GroupItem {
  std::uint32_t pair, k;
  PairRef ref;
  std::uint64_t row;
  Where at_a, at_b;
  PlacedWhere at;

  __device__ GroupItem(const ChunkView& c, const Group& group, std::uint32_t item)
      : pair(group.first + (c.configurations == 1 ? item : item / c.configurations)),
        k(c.configurations == 1 ? 0 : item % c.configurations),
        ref(c.pairs[pair]),
        row(std::uint64_t{k} * c.pair_count + c.position[pair]),
        at_a(c.bodies, c.configurations, ref.a, k),
        at_b(c.bodies, c.configurations, ref.b, k),
        at(at_a, at_b) {}
};

// Answers it and writes its row, unless it is not settled.
template <bool kCompact, bool kWarm, class Hull>
__device__ inline Outcome answer_item(const ChunkView& c, const GroupItem& item, const Hull& a, const Hull& b, Enclosed& enclosed) {
  enclosed.pair = item.pair;
  enclosed.configuration = item.k;
  PairAnswer answer;
  WarmRow* const warm = kWarm ? c.warm + item.k * c.warm_stride + c.position[item.pair] : nullptr;
  Outcome outcome = solve_item<kCompact, kWarm>(c, a, item.at_a, b, item.at_b, item.at, answer, enclosed, warm);
  if (outcome == Outcome::kEnclosed && c.prove_at_once) outcome = proved(c, enclosed, item.at_a, item.at_b, answer);
  if (outcome == Outcome::kWithoutPieces || outcome == Outcome::kSettled)
    write_answer<kCompact>(c, item.row, item.k, item.at_a, item.at_b, answer);
  return outcome;
}

// The last block hands the counts over and leaves them cleared for the next chunk.
__device__ inline void hand_over_counts(const ChunkView& c) {
  if (!c.host_counts) return;
  __syncthreads();
  if (threadIdx.x != 0) return;
  __threadfence();
  if (atomicAdd(c.counts + kBlocksDone, 1) != c.blocks - 1) return;
  __threadfence();
  for (std::uint32_t i = 0; i < kCounts; ++i) c.host_counts[i] = atomicExch(c.counts + i, 0);
}

// Blocks of pairs of the same two hulls, which lie in shared memory.
template <bool kCompact, bool kWarm>
__global__ void __launch_bounds__(kTile, kBlocks) answer_groups(const __grid_constant__ ChunkView c) {
  extern __shared__ uint4 shared_memory[];
  auto* memory = reinterpret_cast<std::byte*>(shared_memory);
  const Group group = c.group_of_tile[blockIdx.x];
  const std::uint32_t place = (blockIdx.x - group.first_tile) * kTile + threadIdx.x, count = group.count * c.configurations;
  const GroupItem item(c, group, place < count ? place : count - 1);  // poses are on their way while hulls are copied
  const HullHead* head = c.hulls.heads + group.hull_a;
  const Hull<SharedVertices> a = share(c.hulls, head, memory);
  const Hull<SharedVertices> b =
      group.hull_a == group.hull_b ? a : share(c.hulls, c.hulls.heads + group.hull_b, memory + shared_bytes(*head));
  __syncthreads();

  Enclosed enclosed;
  report(c, place < count ? answer_item<kCompact, kWarm>(c, item, a, b, enclosed) : Outcome::kNone, item.row, enclosed);
  hand_over_counts(c);
}

// Pairs that have too little company for that: each thread reads the hulls it needs. \param strays their group.
template <bool kCompact, bool kWarm>
__global__ void __launch_bounds__(kTile, kBlocks) answer_strays(const __grid_constant__ ChunkView c, Group strays) {
  const std::uint32_t place = blockIdx.x * kTile + threadIdx.x, count = strays.count * c.configurations;
  const GroupItem item(c, strays, place < count ? place : count - 1);
  const Hull<SceneVertices> a = scene_hull(c, item.ref.a), b = scene_hull(c, item.ref.b);
  Enclosed enclosed;
  report(c, place < count ? answer_item<kCompact, kWarm>(c, item, a, b, enclosed) : Outcome::kNone, item.row, enclosed);
  hand_over_counts(c);
}

}  // namespace clearance::cuda
