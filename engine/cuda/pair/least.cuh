// Minimum over values found by many threads.
#pragma once

#include <cstdint>

namespace clearance::cuda {

// Atomic minimum. A plain read first avoids most atomic operations, since most keys are not less than the current one.
__device__ inline void take_least(std::uint64_t* where, std::uint64_t key) {
  static_assert(sizeof(unsigned long long) == sizeof(std::uint64_t));
  auto* p = reinterpret_cast<unsigned long long*>(where);
  if (key < __ldcg(p)) atomicMin(p, static_cast<unsigned long long>(key));
}
__device__ inline void take_least(std::uint32_t* where, std::uint32_t key) {
  if (key < __ldcg(where)) atomicMin(where, key);
}

}  // namespace clearance::cuda
