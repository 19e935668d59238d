// Boxes that hold whole bodies, in float32, and the least of what many threads find.
#pragma once

#include "engine/device/layout.h"

namespace clearance::cuda {

// The least of many keys. Most keys are not less than what is there already: a look spares the atomic operation.
__device__ inline void take_least(std::uint64_t* where, std::uint64_t key) {
  static_assert(sizeof(unsigned long long) == sizeof(std::uint64_t));
  auto* p = reinterpret_cast<unsigned long long*>(where);
  if (key < __ldcg(p)) atomicMin(p, static_cast<unsigned long long>(key));
}

__device__ inline OuterBox load_box(const BodiesView& bodies, std::uint32_t ref, std::uint32_t k) {
  const OuterBox* box = ref & kMovedBit ? bodies.moved_box + std::size_t{k} * bodies.moved_count + (ref & ~kMovedBit)
                                        : bodies.fixed_box + ref;
  const auto* halves = reinterpret_cast<const float4*>(box);
  const float4 p = __ldg(halves), q = __ldg(halves + 1);
  return {p.x, p.y, p.z, p.w, q.x, q.y, {0, 0}};
}
__device__ inline bool is_empty(const OuterBox& box) {
  return box.low_x > box.high_x;
}
// No more than certify_box_gap() of the boxes: 2^-20 is more than the few roundings take. Finite. Below 0: how far the
// boxes overlap.
__device__ inline float gap_below(const OuterBox& a, const OuterBox& b) {
  constexpr float kMost = 3.4028234e38f;
  float x = fmaxf(b.low_x - a.high_x, a.low_x - b.high_x), y = fmaxf(b.low_y - a.high_y, a.low_y - b.high_y),
        z = fmaxf(b.low_z - a.high_z, a.low_z - b.high_z);
  if (const float most = fmaxf(x, fmaxf(y, z)); most <= 0) return most;
  x = fmaxf(x, 0.0f);
  y = fmaxf(y, 0.0f);
  z = fmaxf(z, 0.0f);
  const float squared = x * x + y * y + z * z;
  const float gap = squared < kMost ? sqrtf(squared) : fmaxf(x, fmaxf(y, z));
  return fminf(gap, kMost) * (1 - 0x1p-20f);
}

}  // namespace clearance::cuda
