// Slack of a pair from the uncertainty of its bodies (docs/trust/bounds_bodies.md, "Slack"): pair_slack() of
// engine/selection/body_poses.h.
#pragma once

#include <type_traits>

#include "engine/device/layout.h"

namespace clearance::cuda {

__device__ inline const BodySlack& slack_of(const ChunkView& c, std::uint32_t ref, std::uint32_t k) {
  const UncertaintyView& uncertainties = c.bodies.uncertainties;
  return ref & kMovedBit ? uncertainties.moved[std::size_t{ref & ~kMovedBit} * c.configurations + k]
                         : uncertainties.fixed[ref];
}

// Not inlined, so that it takes no registers from the iteration.
__device__ __noinline__ inline Slack pair_slack(const ChunkView& c, PairRef ref, std::uint32_t k) {
  const UncertaintyView& uncertainties = c.bodies.uncertainties;
  const BodySlack a = slack_of(c, ref.a, k), b = slack_of(c, ref.b, k);
  const std::uint32_t body_a = ref.a & kMovedBit ? c.bodies.moved_body[ref.a & ~kMovedBit] : ref.a,
                      body_b = ref.b & kMovedBit ? c.bodies.moved_body[ref.b & ~kMovedBit] : ref.b;
  const LinkPlace at_a = uncertainties.links[body_a], at_b = uncertainties.links[body_b];
  if (at_a.robot != kNone && at_a.robot == at_b.robot && at_a.slot != at_b.slot) {
    const double travel = a.travel < b.travel ? b.travel : a.travel;
    const double joints = uncertainties.link_pairs[at_a.first_pair + link_pair_place(at_a.slot, at_b.slot)].at(travel);
    if (joints < __builtin_inf()) return slack_between_links(a.relative, b.relative, joints);
  }
  return a.all + b.all;
}

__device__ inline bool has_uncertainties(const ChunkView& c) {
  return c.bodies.uncertainties.fixed != nullptr;
}
// Zero slack without uncertainty.
__device__ inline Slack slack_of_pair(const ChunkView& c, PairRef ref, std::uint32_t k) {
  return has_uncertainties(c) ? pair_slack(c, ref, k) : Slack();
}

// Replaces Slack in kernels of pairs without uncertainty, so that they compile to the code they would have without
// slack.
struct NoSlack {};
template <class S>
inline constexpr bool kHasSlack = std::is_same_v<S, Slack>;

template <class S>
__device__ inline S known_slack(const ChunkView& c, PairRef ref, std::uint32_t k) {
  if constexpr (kHasSlack<S>)
    return pair_slack(c, ref, k);
  else
    return S();
}

// Limits for decide().
__device__ inline NarrowLimits limits_of(const PairLimits& q) {
  return {q.max_distance, q.abs_tol, q.rel_tol, !q.prove_overlaps};
}

}  // namespace clearance::cuda
