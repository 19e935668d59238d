// Dense chunks: pairs of the same two hulls in blocks of their own, and pairs without company.
#pragma once

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

// Blocks of pairs of the same two hulls, which lie in shared memory.
__global__ void __launch_bounds__(kTile, kBlocks) answer_groups(const __grid_constant__ ChunkView c) {
  extern __shared__ uint4 shared_memory[];
  auto* memory = reinterpret_cast<std::byte*>(shared_memory);
  const Group group = c.groups[c.group_of_tile[blockIdx.x]];
  const HullHead* head = c.hulls.heads + group.hull_a;
  const Hull<SharedVertices> a = share(c.hulls, head, memory);
  const Hull<SharedVertices> b =
      group.hull_a == group.hull_b ? a : share(c.hulls, c.hulls.heads + group.hull_b, memory + shared_bytes(*head));
  __syncthreads();

  const std::uint64_t item = std::uint64_t{blockIdx.x - group.first_tile} * kTile + threadIdx.x;
  Outcome outcome = Outcome::kNone;
  std::uint64_t row = 0;
  Enclosed enclosed;
  if (item < std::uint64_t{group.count} * c.configurations) {
    const std::uint32_t pair = group.first + static_cast<std::uint32_t>(item / c.configurations);
    const std::uint32_t k = static_cast<std::uint32_t>(item % c.configurations);
    row = std::uint64_t{k} * c.pair_count + c.position[pair];
    enclosed.pair = pair;
    enclosed.configuration = k;
    outcome = answer_item(c, a, b, c.pairs[pair], k, row, enclosed);
  }
  report(c, outcome, row, enclosed);
}

// Pairs that have too little company for that: each thread reads the hulls it needs. c.groups is the one group of them.
__global__ void __launch_bounds__(kTile, kBlocks) answer_strays(const __grid_constant__ ChunkView c) {
  const Group group = c.groups[0];
  const std::uint64_t item = std::uint64_t{blockIdx.x} * kTile + threadIdx.x;
  Outcome outcome = Outcome::kNone;
  std::uint64_t row = 0;
  Enclosed enclosed;
  if (item < std::uint64_t{group.count} * c.configurations) {
    const std::uint32_t pair = group.first + static_cast<std::uint32_t>(item / c.configurations);
    const std::uint32_t k = static_cast<std::uint32_t>(item % c.configurations);
    const PairRef ref = c.pairs[pair];
    row = std::uint64_t{k} * c.pair_count + c.position[pair];
    enclosed.pair = pair;
    enclosed.configuration = k;
    outcome = answer_item(c, scene_hull(c, ref.a), scene_hull(c, ref.b), ref, k, row, enclosed);
  }
  report(c, outcome, row, enclosed);
}

}  // namespace clearance::cuda
