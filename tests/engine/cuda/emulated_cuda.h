// Kernels on the CPU: host implementations of the CUDA features they use. Include the headers of the kernels before
// this one, since it defines names that other headers may use, and the kernels after it.
//
// A block's threads are fibers that switch where they wait for each other, so exchanged data is complete. Arithmetic is
// the host's, which gives the same bits for kernels without fused operations.
#pragma once

#include <setjmp.h>
#include <ucontext.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <type_traits>
#include <vector>

#include "engine/selection/columns.h"

using std::isnan;
using std::max;
using std::min;

#define __host__
#define __device__
#define __global__ inline  // several sources of a program may have a kernel
#define __noinline__
#define __forceinline__ inline
#define __launch_bounds__(...)
#define __grid_constant__
#define __shared__ constinit thread_local  // blocks run one after another, on one thread

struct EmulatedDim {
  unsigned x, y, z;
};
inline EmulatedDim threadIdx, blockIdx, blockDim, gridDim;

struct alignas(8) float2 {
  float x, y;
};
struct alignas(16) float4 {
  float x, y, z, w;
};
struct alignas(16) double2 {
  double x, y;
};
struct alignas(16) uint4 {
  unsigned x, y, z, w;
};

namespace clearance::test {

/// The running grid.
class EmulatedGrid {
 public:
  static EmulatedGrid& one() {
    static EmulatedGrid grid;
    return grid;
  }

  /// Runs a kernel's blocks one after another.
  /// \param kernel the call, with its arguments
  void launch(unsigned blocks, unsigned threads, std::function<void()> kernel) {
    launch(EmulatedDim{blocks, 1, 1}, threads, std::move(kernel));
  }
  /// \param blocks along x and along y
  void launch(EmulatedDim blocks, unsigned threads, std::function<void()> kernel) {
    gridDim = blocks;
    blockDim = {threads, 1, 1};
    kernel_ = std::move(kernel);
    warps_.assign(threads / 32, {});
    if (fibers_.size() < threads) fibers_.resize(threads);
    for (unsigned y = 0; y < blocks.y; ++y)
      for (unsigned x = 0; x < blocks.x; ++x) run_block({x, y, 0});
  }

  /// Calls `use` with the values of all threads of the warp, once all have arrived.
  template <class T, class Use>
  auto exchange(T mine, const Use& use) {
    Warp& warp = warps_[threadIdx.x / 32];
    std::memcpy(&warp.brought[threadIdx.x % 32], &mine, sizeof mine);
    wait(warp.barrier, 32);
    const auto result = use([&](unsigned lane) {
      T theirs;
      std::memcpy(&theirs, &warp.brought[lane], sizeof theirs);
      return theirs;
    });
    wait(warp.barrier, 32);
    return result;
  }
  void wait_for_block() { wait(block_, blockDim.x); }

 private:
  /// A fiber starts by ucontext.h, and switches by setjmp.h: swapcontext() makes a system call for the signal mask.
  struct Fiber {
    ucontext_t context{};
    jmp_buf paused{};
    bool has_begun = false;
    std::vector<char> stack = std::vector<char>(1u << 18);
    bool done = false;
  };
  struct Barrier {
    unsigned arrived = 0, round = 0;
  };
  struct Warp {
    Barrier barrier;
    std::uint64_t brought[32] = {};
  };

  void run_block(EmulatedDim at) {
    blockIdx = at;
    block_ = {};
    const std::span<Fiber> fibers(fibers_.data(), blockDim.x);
    for (Fiber& f : fibers) f.done = false;
    for (bool goes_on = true; goes_on;) {
      goes_on = false;
      for (unsigned t = 0; t < fibers.size(); ++t) {
        if (fibers[t].done) continue;
        goes_on = true;
        resume(t);
      }
    }
  }
  void begin(Fiber& f) {
    f.has_begun = true;
    getcontext(&f.context);
    f.context.uc_stack.ss_sp = f.stack.data();
    f.context.uc_stack.ss_size = f.stack.size();
    makecontext(&f.context, [] { one().run(); }, 0);
    setcontext(&f.context);
  }
  /// Main function of a fiber: runs one kernel after another.
  void run() {
    for (;;) {
      kernel_();
      fibers_[threadIdx.x].done = true;
      pause();
    }
  }
  void resume(unsigned thread) {
    threadIdx = {thread, 0, 0};
    Fiber& fiber = fibers_[thread];
    if (_setjmp(scheduler_) != 0) return;
    if (fiber.has_begun) _longjmp(fiber.paused, 1);
    begin(fiber);
  }
  void pause() {
    if (_setjmp(fibers_[threadIdx.x].paused) == 0) _longjmp(scheduler_, 1);
  }
  void wait(Barrier& barrier, unsigned threads) {
    const unsigned round = barrier.round;
    if (++barrier.arrived == threads) {
      barrier.arrived = 0;
      ++barrier.round;
    }
    while (barrier.round == round) pause();
  }

  std::function<void()> kernel_;
  std::vector<Fiber> fibers_;
  std::vector<Warp> warps_;
  Barrier block_;
  jmp_buf scheduler_{};
};

}  // namespace clearance::test

// All threads take part in warp operations; masks are ignored.
inline unsigned __ballot_sync(unsigned, bool x) {
  return clearance::test::EmulatedGrid::one().exchange(x, [](const auto& of) {
    unsigned bits = 0;
    for (unsigned lane = 0; lane < 32; ++lane) bits |= unsigned{of(lane)} << lane;
    return bits;
  });
}
inline bool __any_sync(unsigned mask, bool x) {
  return __ballot_sync(mask, x) != 0;
}
inline bool __all_sync(unsigned mask, bool x) {
  return __ballot_sync(mask, x) == ~0u;
}
template <class T>
T __shfl_sync(unsigned, T x, int lane) {
  return clearance::test::EmulatedGrid::one().exchange(
      x, [&](const auto& of) { return of(static_cast<unsigned>(lane) % 32); });
}
template <class T>
T __shfl_xor_sync(unsigned mask, T x, int step) {
  return __shfl_sync(mask, x, static_cast<int>(threadIdx.x % 32) ^ step);
}
// Value of the lane `step` below; the first lanes keep their own.
template <class T>
T __shfl_up_sync(unsigned mask, T x, int step) {
  const int lane = static_cast<int>(threadIdx.x % 32);
  return __shfl_sync(mask, x, lane < step ? lane : lane - step);
}
inline void __syncwarp() {
  __ballot_sync(~0u, true);
}
inline void __syncthreads() {
  clearance::test::EmulatedGrid::one().wait_for_block();
}
inline void __threadfence() {}
inline void __threadfence_system() {}

inline int __popc(unsigned x) {
  return std::popcount(x);
}
inline int __ffs(int x) {
  return __builtin_ffs(x);
}
template <class T>
T __ldg(const T* p) {
  return *p;
}
template <class T>
T __ldcg(const T* p) {
  return *p;
}
inline float __double2float_ru(double x) {
  return clearance::detail::float_above(x);
}
inline float __double2float_rd(double x) {
  return clearance::detail::float_below(x);
}
inline float __fmaf_rn(float a, float b, float c) {
  return std::fma(a, b, c);
}
inline float __uint_as_float(unsigned x) {
  return std::bit_cast<float>(x);
}
inline unsigned __float_as_uint(float x) {
  return std::bit_cast<unsigned>(x);
}
inline long long __double_as_longlong(double x) {
  return std::bit_cast<long long>(x);
}
inline double __longlong_as_double(long long x) {
  return std::bit_cast<double>(x);
}

template <class T, class Next>
T emulated_update(T* p, const Next& next) {
  const T before = *p;
  *p = next(before);
  return before;
}
template <class T>
T atomicAdd(T* p, std::type_identity_t<T> x) {
  return emulated_update(p, [x](T before) { return before + x; });
}
template <class T>
T atomicMin(T* p, std::type_identity_t<T> x) {
  return emulated_update(p, [x](T before) { return x < before ? x : before; });
}
template <class T>
T atomicAnd(T* p, std::type_identity_t<T> x) {
  return emulated_update(p, [x](T before) { return before & x; });
}
template <class T>
T atomicExch(T* p, std::type_identity_t<T> x) {
  return emulated_update(p, [x](T) { return x; });
}
