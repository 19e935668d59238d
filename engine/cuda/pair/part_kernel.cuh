// Pairs with a body of several convex parts, by the search of engine/narrow/part_search.h: one thread per pair, which
// evaluates its part pairs in sequence.
#pragma once

#include "engine/cuda/pair/overlap_kernel.cuh"
#include "engine/narrow/part_search.h"

namespace clearance::cuda {

// Part pairs of a pair that are sorted at a time. Most pairs need at most three rounds.
inline constexpr int kOrderedParts = 8;

// A body's convex parts in one configuration, with their boxes.
struct ConvexParts {
  const double* boxes;
  std::size_t stride;
  const std::uint32_t* hulls;
  std::uint32_t count;

  __device__ ConvexParts(const ChunkView& c, std::uint32_t ref, std::uint32_t k, std::uint32_t body) {
    const std::uint32_t first = c.hulls.part_begin[body];
    hulls = c.hulls.part_hull + first;
    count = c.hulls.part_begin[body + 1] - first;
    if (ref & kMovedBit) {
      boxes =
          c.bodies.moved_part_box + std::size_t{c.bodies.moved_part_begin[ref & ~kMovedBit]} * 6 * c.configurations + k;
      stride = c.configurations;
    } else {
      boxes = c.bodies.fixed_part_box + std::size_t{first} * 6;
      stride = 1;
    }
  }
  __device__ Aabb operator()(std::uint32_t i) const {
    const double* p = boxes + std::size_t{i} * 6 * stride;
    return {{p[0], p[stride], p[2 * stride]}, {p[3 * stride], p[4 * stride], p[5 * stride]}};
  }
};

// The hulls of a pair's convex parts with the nearest boxes.
struct PairHeads {
  const HullHead *a, *b;
};
__device__ __noinline__ inline PairHeads nearest_heads(const ChunkView& c, PairRef ref, std::uint32_t k,
                                                       std::uint32_t body_a, std::uint32_t body_b) {
  const ConvexParts a(c, ref.a, k, body_a), b(c, ref.b, k, body_b);
  NearestConvexParts<1, ConvexParts, ConvexParts> nearest(a, a.count, b, b.count);
  PartPair p;
  nearest.next(p);
  return {c.hulls.heads + a.hulls[p.a], c.hulls.heads + b.hulls[p.b]};
}

// Answers a pair, if it converges.
// \param margin optional: an upper bound this low is sufficient
// \tparam kBoth float32 is tried first where requested and possible
template <bool kBoth, class... Margin>
__device__ inline PairOutcome solve_parts(const ChunkView& c, const PairLimits& pair_limits, PairRef ref,
                                          std::uint32_t k, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                          PairAnswer& answer, const Margin&... margin) {
  if (answer_without_parts(pair_limits, at_a, at_b, answer)) return PairOutcome::kWithoutParts;
  const ConvexParts a(c, ref.a, k, at_a.body), b(c, ref.b, k, at_b.body);
  const auto head_a = [&](std::uint32_t i) { return c.hulls.heads + a.hulls[i]; };
  const auto head_b = [&](std::uint32_t i) { return c.hulls.heads + b.hulls[i]; };
  NearestConvexParts<kOrderedParts, ConvexParts, ConvexParts> nearest(a, a.count, b, b.count);
  PartSearch search;
  PartPair best{};
  LaneWitness witness;
  const auto evaluate = [&](const PartPair& p, double cut_off) {
    const HullHead *of_a = head_a(p.a), *of_b = head_b(p.b);
    PairLimits q = pair_limits;
    q.max_distance = cut_off;
    q.prove_depths = false;  // the deepest of several convex parts decides
    Enclosed enclosed;
    const auto take = [&](const auto& g, const auto& bounds) {
      if (!search.take(p.gap, bounds.lower, bounds.upper)) return;
      best = p;
      if (q.want_points) witness = witness_of(g, bounds, at_a.rotation());
    };
    if (kBoth && pair_limits.f32 && fit_f32(*of_a, *of_b)) {
      const PairFrame<float> at = place_pair<float>(at_a, *of_a, at_b, *of_b);
      if (run_to_end(q, scene_hull_f32(c.hulls, of_a), scene_hull_f32(c.hulls, of_b), at, enclosed, take,
                     slack_of_pair(c, ref, k).near_enough(margin)...) == PairOutcome::kConverged)
        return PartEnd::kApart;
    }
    const PairFrame<double> at = place_pair<double>(at_a, *of_a, at_b, *of_b);
    const PairOutcome outcome = run_to_end(q, scene_hull(c.hulls, of_a), scene_hull(c.hulls, of_b), at, enclosed, take,
                                           slack_of_pair(c, ref, k).near_enough(margin)...);
    if (outcome == PairOutcome::kConverged) return PartEnd::kApart;
    if (outcome != PairOutcome::kEnclosed) return PartEnd::kOpen;
    const double outer = slack_of_pair(c, ref, k).outer;
    if (!prove_overlap(c, *of_a, *of_b, enclosed, at_a, at_b, outer, answer)) return PartEnd::kOpen;
    best = p;
    return PartEnd::kOverlap;
  };
  const double cut_off = slack_of_pair(c, ref, k).cut_off(pair_limits.max_distance);
  const PartEnd end = search_parts(search, cut_off, nearest, evaluate, slack_of_pair(c, ref, k).near_enough(margin)...);
  if (end == PartEnd::kOpen || (end == PartEnd::kApart && !(search.upper < __builtin_inf())))
    return PairOutcome::kUnresolved;
  if (end == PartEnd::kApart) {
    const HullHead *of_a = head_a(best.a), *of_b = head_b(best.b);
    const auto rounding = [&] {
      const PairFrame<double> at = place_pair<double>(at_a, *of_a, at_b, *of_b);
      return rounding_width(pair_scale(at.D, of_a->rho, of_b->rho, of_a->radius + of_b->radius));
    };
    decide(limits_of(pair_limits), search.lower, search.upper, rounding, answer, slack_of_pair(c, ref, k));
    if (pair_limits.want_points)
      add_points(scene_hull(c.hulls, of_a), at_a, scene_hull(c.hulls, of_b), at_b, witness, pair_limits.want_nonsmooth,
                 answer);
  }
  answer.part_a = best.a;
  answer.part_b = best.b;
  return PairOutcome::kConverged;
}

}  // namespace clearance::cuda
