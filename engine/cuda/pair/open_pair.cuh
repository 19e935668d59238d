// Pairs that the device cannot resolve, for queries without a CPU to finish them. They get the bounds that their run
// proves, with the corresponding status.
#pragma once

#include "engine/cuda/pair/overlap_kernel.cuh"
#include "engine/cuda/pair/part_kernel.cuh"

namespace clearance::cuda {

// The face of a simplex that is nearest to the origin, with the weights of the nearest point. A run that ended on the
// origin has no weights.
__device__ __noinline__ inline Simplex<double> weighed(const Simplex<double>& s) {
  Simplex<double> best;
  double least = __builtin_inf();
  for (int i = 0; i < s.size; ++i) {
    Simplex<double> others;
    for (int k = 1; k < s.size; ++k) others.vertex[others.size++] = s.vertex[(i + k) % s.size];
    const Nearest<double> nearest = reduce_carefully(others, s.vertex[i]);
    if (nearest.encloses) {
      best = s;
      weigh_origin(best);
      return best;
    }
    if (nearest.simplex.size > 0 && nearest.squared_distance < least) {
      least = nearest.squared_distance;
      best = nearest.simplex;
    }
  }
  return best.size > 0 ? best : s;
}

// Bounds of a pair of hulls by one more run in float64. The nearest point of its last simplex belongs to the Minkowski
// difference (CSO), however the run ended, so it gives an upper bound. The lower bound comes from the run's planes, or
// is 0.
// \param q limits of the pair
// \param whole whether the hulls are the whole bodies; if not, other convex parts may be nearer
// \param slack of the pair
__device__ __noinline__ inline void answer_open_pair(const ChunkView& c, const PairLimits& q, const PairHeads& heads,
                                                     bool whole, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                                     const Slack& slack, PairAnswer& answer) {
  const Hull<SceneVertices> a = scene_hull(c.hulls, heads.a), b = scene_hull(c.hulls, heads.b);
  const PairFrame<double> at = place_pair<double>(at_a, *heads.a, at_b, *heads.b);
  PairLimits of_parts = q;
  of_parts.max_distance = slack.cut_off(q.max_distance);
  GjkRun<Hull<SceneVertices>> run(of_parts, a, b, at);
  run.run();
  const RunBounds<double> bounds = run.bounds();
  const Simplex<double> last = weighed(run.g.simplex);
  const auto vertex_a = [&](std::uint32_t i) { return a.vertex(i); };
  const auto vertex_b = [&](std::uint32_t i) { return b.vertex(i); };
  const CsoPoint<double> point(last, at_a.rotation(), vertex_a, at_b.rotation(), vertex_b);
  const double radius = run.radius, length = norm(point.w);
  const double upper =
      upper_from_point(length, radius, rounding_error(double(RoundingUnits<double>::kUpper), run.scale) + at.extra);
  const double lower = whole ? bounds.lower : -__builtin_inf();
  if (!(lower <= upper)) {  // NaN, or bounds that contradict each other
    const std::uint16_t flags = answer.flags;
    answer = unproved_answer();
    answer.flags = flags;
    return;
  }
  decide(
      {q.max_distance, q.abs_tol, q.rel_tol}, lower, upper, [&] { return rounding_width(run.scale); }, answer, slack);
  answer.part_a = answer.part_b = whole ? 0 : kNone;
  const double share = radius > 0 ? heads.a->radius / radius : 0.5;
  const bool apart = length > 0 && upper > 0;
  // For rounded cores the points lie on the rounded surfaces. If the convex parts overlap, both points are halfway.
  const Vec3d n = length > 0 ? point.separation * (1 / length) : Vec3d{1, 0, 0};
  const double from_a = apart ? heads.a->radius : length * share,
               from_b = apart ? heads.b->radius : length * (1 - share);
  answer.point_a = point.core_a + n * from_a;
  answer.point_b = point.core_b - n * from_b;
  answer.normal = n;
  if (answer.status == Status::kBeyond) answer.point_a = answer.point_b = no_point();
  if (q.want_nonsmooth) answer.flags |= kFlagNonsmooth;
}

// The same for a pair of any geometry in a configuration. \returns its answer
__device__ inline PairAnswer open_answer(const ChunkView& c, const PairLimits& q, PairRef ref, std::uint32_t k,
                                         const BodyPoseRef& at_a, const BodyPoseRef& at_b) {
  const bool several = has_several(c.hulls, at_a.body, at_b.body);
  const PairHeads heads =
      several ? nearest_heads(c, ref, k, at_a.body, at_b.body)
              : PairHeads{c.hulls.heads + c.hulls.of_body[at_a.body], c.hulls.heads + c.hulls.of_body[at_b.body]};
  PairAnswer answer;
  answer.flags = flags_of(at_a, at_b);
  answer_open_pair(c, q, heads, !several, at_a, at_b, slack_of_pair(c, ref, k), answer);
  return answer;
}

}  // namespace clearance::cuda
