// Teams of a warp's threads, and their comparison of the boxes of all pairs of a configuration.
#pragma once

#include "engine/cuda/pair/items.cuh"
#include "engine/cuda/pair/outer_box.cuh"

namespace clearance::cuda {

// Threads of a warp that share a configuration. All threads of the warp call the collective members.
template <std::uint32_t kLanes>
struct Team {
  std::uint32_t lane = threadIdx.x % kLanes, first = threadIdx.x % 32 / kLanes * kLanes;

  __device__ std::uint32_t ballot(bool x) const { return __ballot_sync(~0u, x) >> first & (~0u >> (32 - kLanes)); }
  __device__ static std::uint32_t all(std::uint32_t bits) {
    for (int step = kLanes / 2; step > 0; step /= 2) bits |= __shfl_xor_sync(~0u, bits, step);
    return bits;
  }
  template <class T>
  __device__ static T least(T x) {
    for (int step = kLanes / 2; step > 0; step /= 2) {
      const T other = __shfl_xor_sync(~0u, x, step);
      if (other < x) x = other;
    }
    return x;
  }
};
__device__ inline std::uint32_t bits_before(std::uint32_t lane) {
  return (1u << lane) - 1;
}
__device__ inline std::uint32_t first_bit(std::uint32_t bits) {
  return static_cast<std::uint32_t>(__ffs(static_cast<int>(bits))) - 1;
}

// Squared distance at which two bodies are likely to be, given the squared gap of their boxes: that of balls inscribed
// in boxes of these sizes that face each other corner to corner.
__device__ inline float likely_reach(const OuterBox& a, const OuterBox& b, float squared) {
  const auto size = [](const OuterBox& x) {
    return (x.high_x - x.low_x) + (x.high_y - x.low_y) + (x.high_z - x.low_z);
  };
  const float reach = sqrtf(squared) + (size(a) + size(b)) * 0.125f;
  return squared > 0 ? fminf(fmaxf(reach * reach, squared), 3.4028234e38f) : 0.0f;
}

// A configuration's pairs, in query order.
struct ConfigurationPairs {
  const ReducedView& r;
  std::uint32_t k;

  __device__ std::uint32_t count() const { return r.chunk.pair_count; }
  __device__ PairRef ref(std::uint32_t i) const { return r.chunk.pairs[i]; }
  __device__ OuterBox box_a(std::uint32_t i) const { return load_box(r.chunk, ref(i).a, k); }
  __device__ OuterBox box_b(std::uint32_t i) const { return load_box(r.chunk, ref(i).b, k); }
  __device__ bool has_poses(std::uint32_t i) const { return !is_empty(box_a(i)) && !is_empty(box_b(i)); }
  __device__ std::uint32_t row(std::uint32_t i) const {
    return k * r.chunk.pair_count + i;
  }  // in the chunk, over all pairs
};

// Result of a team's comparison of all boxes.
struct BoxScan {
  float reach = __builtin_inff();    // squared likely distance of the nearest pair; infinite if no pair has poses
  std::uint32_t unusable = kNoPair;  // first pair without usable poses
};
template <std::uint32_t kLanes>
__device__ inline BoxScan scan_boxes(const ConfigurationPairs& members, const Team<kLanes>& team) {
  constexpr float kInf = __builtin_inff();
  BoxScan scan;
  float least = kInf;
  std::uint32_t nearest = kNone;
  bool all_placed = true;
#pragma unroll 4
  for (std::uint32_t i = team.lane; i < members.count(); i += kLanes) {  // without branches, so that loads overlap
    const float squared = squared_gap(members.box_a(i), members.box_b(i));
    const bool is_nearer = squared < least;
    least = is_nearer ? squared : least;
    nearest = is_nearer ? i : nearest;
    all_placed = all_placed && squared < kInf;
  }
  if (nearest != kNone) scan.reach = likely_reach(members.box_a(nearest), members.box_b(nearest), least);
  scan.reach = team.least(scan.reach);
  // Some pairs may lack poses, or their squared gap may overflow a float.
  if (__any_sync(~0u, !all_placed)) {
    const bool any = scan.reach == kInf;
    for (std::uint32_t i = team.lane; i < members.count() && !all_placed; i += kLanes) {
      if (!members.has_poses(i)) {
        if (scan.unusable == kNoPair) scan.unusable = i;
      } else if (any) {
        scan.reach = 3.4028234e38f;
      }
    }
    scan.reach = team.least(scan.reach);
    scan.unusable = team.least(scan.unusable);
  }
  return scan;
}

}  // namespace clearance::cuda
