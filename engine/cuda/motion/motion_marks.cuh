// Per-motion records that kernels keep while evaluating spans (engine/device/motion_layout.h).
#pragma once

#include "engine/cuda/motion/motion_rates.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kMotionThreads = 128;

__device__ inline std::uint32_t& count_of(const MotionsView& m, std::uint32_t which, std::uint32_t level) {
  return m.counts[level * kCountsOfLevel + which];
}
__device__ inline std::uint32_t listed(std::uint32_t count, std::uint32_t capacity) {
  return count < capacity ? count : capacity;
}
__device__ inline std::uint32_t span_count(const MotionsView& m) {
  return listed(count_of(m, kSpanCount, m.level), m.span_capacity);
}
__device__ inline std::uint32_t thread_index() {
  return blockIdx.x * blockDim.x + threadIdx.x;
}
__device__ inline double margin_of(const MotionsView& m, std::uint32_t pair) {
  return m.margins ? m.margins[pair] : m.margin;
}
// Required distance of a pair over a whole span.
// \param inner of its slack
__device__ inline double target_of(const MotionsView& m, const MotionSpan& span, std::uint32_t pair, double inner) {
  const double required_distance = span.required_distance - inner;
  if (span.late) return required_distance;
  const double margin = margin_of(m, pair);
  return margin < required_distance ? required_distance : margin;
}
// Key that orders the hits of a motion: by pair in query order, then by time; with first contact, by time, then by
// pair. A time is a multiple of 2^-31, since it is the middle of a span that is cut at multiples of 2^-12 and halved at
// most kContactLevels times.
static_assert(kSpanGrid * 0x1p-19 == 0x1p-31 && kContactLevels < 19);
__device__ inline std::uint64_t hit_key(const MotionsView& m, std::uint32_t pair, double time) {
  const auto at = static_cast<std::uint64_t>(time * 0x1p31);
  return m.seeks_contact ? at << 32 | pair : std::uint64_t{pair} << 32 | at;
}
constexpr std::uint64_t kNoHit = ~std::uint64_t{0};
// With first contact: time of the earliest pair known to be within its margin; inf if none is.
__device__ inline double time_of_hit(const MotionsView& m, std::uint32_t motion) {
  const std::uint64_t key = m.hit[motion];
  return key == kNoHit ? __builtin_inf() : static_cast<double>(key >> 32) * 0x1p-31;
}
// Whether a pair before this one decides the motion.
__device__ inline bool is_hit_before(const MotionsView& m, std::uint32_t motion, std::uint32_t pair) {
  return !m.seeks_contact && __ldcg(m.hit + motion) < hit_key(m, pair, 0);
}
// Limits the time before which all pairs are beyond their margins. Times are non-negative, so their order is that of
// their bits.
__device__ inline void free_no_longer(const MotionsView& m, std::uint32_t motion, double time) {
  take_least(reinterpret_cast<std::uint64_t*>(m.free_until) + motion,
             static_cast<std::uint64_t>(__double_as_longlong(time)));
}

}  // namespace clearance::cuda
