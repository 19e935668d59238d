// The threads of a warp as a team (engine/narrow/team.h). All of them call these functions together.
#pragma once

#include "engine/narrow/team.h"

namespace clearance::cuda {

struct WarpTeam {
  static constexpr std::uint32_t kSize = 32;
  __device__ static std::uint32_t rank() { return threadIdx.x % 32; }
  __device__ static void sync() { __syncwarp(); }
  __device__ static bool all(bool x) { return __all_sync(~0u, x); }
  __device__ static bool any(bool x) { return __any_sync(~0u, x); }
  template <class T, class Before>
  __device__ static Ranked<T> best(Ranked<T> mine, const Before& before) {
    for (int step = 16; step > 0; step /= 2) {
      const Ranked<T> other{__shfl_xor_sync(~0u, mine.value, step), __shfl_xor_sync(~0u, mine.index, step)};
      if (before(other, mine)) mine = other;
    }
    return mine;
  }
  __device__ static void append(std::uint32_t* list, std::size_t& count, std::uint32_t value, bool wanted) {
    const unsigned all = __ballot_sync(~0u, wanted);
    if (wanted) list[count + __popc(all & ((1u << rank()) - 1))] = value;
    count += __popc(all);
  }
  template <class Work>
  __device__ static std::uint32_t lead(const Work& work) {
    __syncwarp();  // all threads have read the data that `work` changes
    std::uint32_t number = 0;
    if (rank() == 0) number = work();
    __syncwarp();  // all threads see its changes
    return __shfl_sync(~0u, number, 0);
  }
};

}  // namespace clearance::cuda
