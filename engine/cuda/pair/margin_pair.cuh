// Decides only on which side of a margin a pair is.
#pragma once

#include "engine/cuda/pair/overlap_kernel.cuh"
#include "engine/cuda/pair/part_kernel.cuh"

namespace clearance::cuda {

// A pair of single convex parts.
// \param q whose max_distance is the distance up to which bounds are needed
// \param margin at which an upper bound is low enough
// \tparam S Slack for uncertain pairs, else NoSlack
template <class S>
__device__ inline PairOutcome narrow_to_margin(const ChunkView& c, const PairLimits& q, double margin, PairRef ref,
                                               std::uint32_t k, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                               PairAnswer& answer, const S& slack) {
  const HullHead *head_a = head_of(c, ref.a), *head_b = head_of(c, ref.b);
  const Hull<SceneVertices> a = scene_hull(c.hulls, head_a), b = scene_hull(c.hulls, head_b);
  const PairFrame<double> at = place_pair<double>(at_a, *head_a, at_b, *head_b);
  const auto take = [&](const Gjk<double>& g, const RunBounds<double>& bounds) {
    take_converged<false>(q, PairHulls<Hull<SceneVertices>>{a, b}, at_a, at_b, g, bounds, answer, slack);
  };
  PairLimits of_parts = q;
  double near_enough = margin;
  if constexpr (kHasSlack<S>) {
    of_parts.max_distance = slack.cut_off(q.max_distance);
    near_enough = slack.near_enough(margin);
  }
  Enclosed enclosed;
  const PairOutcome outcome = run_to_end(of_parts, a, b, at, enclosed, take, near_enough);
  if (outcome != PairOutcome::kEnclosed) return outcome;
  return proved(c, enclosed, at_a, at_b, slack_of_pair(c, ref, k).outer, answer);
}

// The same for pairs of any geometry.
template <class S>
__device__ inline PairOutcome evaluate_at_margin(const ChunkView& c, const PairLimits& q, double margin, PairRef ref,
                                                 std::uint32_t k, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                                 PairAnswer& answer) {
  if (has_several(c.hulls, at_a.body, at_b.body)) return solve_parts<false>(c, q, ref, k, at_a, at_b, answer, margin);
  if (answer_without_parts(q, at_a, at_b, answer)) return PairOutcome::kWithoutParts;
  return narrow_to_margin(c, q, margin, ref, k, at_a, at_b, answer, known_slack<S>(c, ref, k));
}

}  // namespace clearance::cuda
