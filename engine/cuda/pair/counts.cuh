// Counts and lists of a chunk in device memory, and their way to the host.
#pragma once

#include "engine/device/layout.h"

namespace clearance::cuda {

// Reserves list positions, and counts, with one atomic operation per warp. All threads of the warp call these.
__device__ inline std::uint32_t take_place(std::uint32_t* count, bool wanted) {
  const unsigned all = __ballot_sync(~0u, wanted), lane = threadIdx.x % 32;
  if (all == 0) return 0;
  std::uint32_t first = 0;
  if (lane == 0) first = atomicAdd(count, __popc(all));
  return __shfl_sync(~0u, first, 0) + __popc(all & ((1u << lane) - 1));
}
// The same with one atomic operation per block, for several items of each thread. All threads of the block call it.
// Positions increase with the item, then with the thread.
// \tparam kThreads of the block
template <std::uint32_t kThreads, std::uint32_t kItems>
__device__ inline void take_places_of_block(std::uint32_t* count, const bool (&wanted)[kItems],
                                            std::uint32_t (&place)[kItems]) {
  constexpr std::uint32_t kWarps = kThreads / 32, kAll = kItems * kWarps;
  static_assert(kAll <= 32, "the first warp adds them");
  __shared__ std::uint32_t places[kAll];
  const std::uint32_t lane = threadIdx.x % 32, warp = threadIdx.x / 32;
  unsigned all[kItems];
  for (std::uint32_t i = 0; i < kItems; ++i) {
    all[i] = __ballot_sync(~0u, wanted[i]);
    if (lane == 0) places[i * kWarps + warp] = __popc(all[i]);
  }
  __syncthreads();
  if (warp == 0) {
    const std::uint32_t own = lane < kAll ? places[lane] : 0;
    std::uint32_t sum = own;
    for (int step = 1; step < 32; step *= 2) {
      const std::uint32_t before = __shfl_up_sync(~0u, sum, step);
      if (lane >= static_cast<std::uint32_t>(step)) sum += before;
    }
    std::uint32_t first = 0;
    if (lane == 31 && sum > 0) first = atomicAdd(count, sum);
    first = __shfl_sync(~0u, first, 31);
    if (lane < kAll) places[lane] = first + sum - own;
  }
  __syncthreads();
  for (std::uint32_t i = 0; i < kItems; ++i) place[i] = places[i * kWarps + warp] + __popc(all[i] & ((1u << lane) - 1));
}
template <std::uint32_t kThreads>
__device__ inline std::uint32_t take_place_of_block(std::uint32_t* count, bool wanted) {
  std::uint32_t place[1];
  take_places_of_block<kThreads>(count, {wanted}, place);
  return place[0];
}
__device__ inline void add_count(std::uint32_t* count, bool wanted) {
  const unsigned all = __ballot_sync(~0u, wanted);
  if (all != 0 && threadIdx.x % 32 == 0) atomicAdd(count, __popc(all));
}

// Device clock, in nanoseconds.
__device__ inline std::uint64_t clock_ns() {
#ifdef __CUDA_ARCH__
  std::uint64_t ns;
  asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(ns));
  return ns;
#else
  return 1;
#endif
}
// Records the start of a dense chunk. Called by every kernel that may be its first.
__device__ inline void note_begin(const ChunkView& c) {
  if (blockIdx.x == 0 && threadIdx.x == 0 && c.begun && *c.begun == 0) *c.begun = clock_ns();
}

// The last block copies the counts to the host, one thread per count, and clears them for the next chunk. All threads
// of a block call it.
__device__ inline void hand_over_counts(const ChunkView& c) {
  if (!c.host_counts) return;
  __shared__ bool is_last;
  __syncthreads();
  if (threadIdx.x == 0) {
    if (c.number != 0)
      __threadfence_system();  // the block's rows are in host memory before it counts as done
    else
      __threadfence();
    is_last = atomicAdd(c.counts + kBlocksDone, 1) == c.blocks - 1;
  }
  __syncthreads();
  if (!is_last || threadIdx.x >= 32) return;
  __threadfence();
  if (threadIdx.x < kCounts) c.host_counts[threadIdx.x] = atomicExch(c.counts + threadIdx.x, 0);
  __syncwarp();
  if (threadIdx.x > 0 || !c.begun) return;
  c.finished->begun = *c.begun;
  c.finished->ended = clock_ns();
  *c.begun = 0;
  if (c.number == 0) return;
  __threadfence_system();
  *static_cast<volatile std::uint32_t*>(&c.finished->number) = c.number;
}

}  // namespace clearance::cuda
