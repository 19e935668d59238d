// Bodies' boxes in float32, as compared by kernels.
#pragma once

#include <cstddef>

#include "engine/device/layout.h"

namespace clearance::cuda {

__device__ inline OuterBox load_box(const ChunkView& c, std::uint32_t ref, std::uint32_t k) {
  const OuterBox* box = ref & kMovedBit ? c.bodies.moved_box + std::size_t{ref & ~kMovedBit} * c.configurations + k
                                        : c.bodies.fixed_box + ref;
  const auto* halves = reinterpret_cast<const float4*>(box);
  const float4 p = __ldg(halves), q = __ldg(halves + 1);
  return {p.x, p.y, p.z, p.w, q.x, q.y, {0, 0}};
}
struct PairBoxes {
  OuterBox a, b;
};
__device__ inline PairBoxes boxes_of(const ChunkView& c, PairRef ref, std::uint32_t k) {
  return {load_box(c, ref.a, k), load_box(c, ref.b, k)};
}
__device__ inline bool is_empty(const OuterBox& box) {
  return box.low_x > box.high_x;
}
// Finite lower bound on certify_box_gap() of the boxes; the factor 1 - 2^-20 exceeds the few roundings. If negative,
// its magnitude is the overlap of the boxes.
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

// Squared gap between boxes, up to a few roundings; 0 if they touch. Infinite if a body has no usable pose, and on
// overflow.
__device__ inline float squared_gap(const OuterBox& a, const OuterBox& b) {
  const float x = fmaxf(fmaxf(b.low_x - a.high_x, a.low_x - b.high_x), 0.0f),
              y = fmaxf(fmaxf(b.low_y - a.high_y, a.low_y - b.high_y), 0.0f),
              z = fmaxf(fmaxf(b.low_z - a.high_z, a.low_z - b.high_z), 0.0f);
  return __fmaf_rn(x, x, __fmaf_rn(y, y, z * z));
}
// Threshold for squared_gap(): a greater value proves that boxes are farther apart than the distance. Its margin
// exceeds the few roundings of squared_gap().
__host__ __device__ inline float square_from_above(double distance) {
  return detail::float_above(distance * distance * (1 + 0x1p-18));
}

}  // namespace clearance::cuda
