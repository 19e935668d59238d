// Pairs of single convex parts, if the least distance is not requested. The first kernel only iterates: most pairs end
// beyond their targets over the whole span. The second divides the pairs that are apart at its middle. The kernel of
// motion_kernel.cuh evaluates all others: overlaps, pairs within their margins, several parts.
#pragma once

#include "engine/cuda/motion/motion_kernel.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kIterateThreads = 64;  // of a block that only iterates
inline constexpr int kIterateBlocks = 8;              // on a multiprocessor, which share its registers

enum class SpanOutcome { kBeyond, kApart, kLater };

// Iterates on a pair at the middle of its span.
// \param way upper bound on its approach until the ends, in metres
__device__ inline SpanOutcome iterate_at_middle(const MotionsView& m, const SpanPair& item, double way,
                                                ApartPair& apart) {
  const ChunkView& c = m.chunk;
  const PairRef ref = c.pairs[item.pair];
  const BodyPoseRef at_a(c.bodies, m.span_capacity, ref.a, item.span),
      at_b(c.bodies, m.span_capacity, ref.b, item.span);
  if (has_several(c.hulls, at_a.body, at_b.body) || at_a.status() != Status::kOk || at_b.status() != Status::kOk)
    return SpanOutcome::kLater;
  const HullHead *head_a = head_of(c, ref.a), *head_b = head_of(c, ref.b);
  const PairFrame<double> at = place_pair<double>(at_a, *head_a, at_b, *head_b);
  const Slack slack = known_slack<Slack>(c, ref, item.span);
  const double margin = margin_of(m, item.pair), required = sum_above(margin, way);
  PairLimits q = c.pair_limits;
  q.max_distance = slack.cut_off(required);
  if (q.rel_tol < kRoughMotion) q.rel_tol = kRoughMotion;
  double lower = 0;
  Vec3d normal{0, 0, 0};
  SpanOutcome end = SpanOutcome::kLater;
  const auto take = [&](const Gjk<double>& g, const RunBounds<double>& bounds) {
    lower = slack.true_lower(bounds.lower);
    if (!(lower > margin && lower > 0)) return;
    end = lower > required ? SpanOutcome::kBeyond : SpanOutcome::kApart;
    if (end == SpanOutcome::kApart) normal = converged_normal(witness_of(g, bounds, at_a.rotation()));
  };
  Enclosed enclosed;
  run_to_end(q, indexed_hull(c.hulls, head_a), indexed_hull(c.hulls, head_b), at, enclosed, take,
             slack.near_enough(margin));
  if (end == SpanOutcome::kApart) apart = {item, lower, normal};
  return end;
}

__global__ void __launch_bounds__(kIterateThreads, kIterateBlocks)
    iterate_span_pairs(const __grid_constant__ MotionsView m) {
  const std::uint32_t count = listed(count_of(m, kEvaluateCount, m.level), m.pair_capacity);
  for (std::uint32_t first = blockIdx.x * kIterateThreads; first < count; first += gridDim.x * kIterateThreads) {
    const std::uint32_t i = first + threadIdx.x;
    bool wanted = i < count, is_apart = false, is_later = false;
    SpanPair item{0, 0};
    ApartPair apart;
    if (wanted) {
      item = m.to_evaluate[i];
      wanted = !is_hit_before(m, m.spans[item.span].motion, item.pair);
    }
    if (wanted) {
      const SpanOutcome end = iterate_at_middle(m, item, m.ways[i], apart);
      is_apart = end == SpanOutcome::kApart;
      is_later = end == SpanOutcome::kLater;
    }
    add_count(m.counts + kConvergedCount, wanted && !is_later);
    const std::uint32_t place = take_place(&count_of(m, kApartCount, m.level), is_apart);
    if (is_apart && place < m.apart_capacity)
      m.apart[place] = apart;
    else
      is_later |= is_apart;
    const std::uint32_t later = take_place(&count_of(m, kLaterCount, m.level), is_later);
    if (is_later) m.near[later] = item;
  }
}

// Divides the pairs that are apart at the middle of a span.
__global__ void __launch_bounds__(kMotionThreads) divide_span_pairs(const __grid_constant__ MotionsView m) {
  const std::uint32_t count = listed(count_of(m, kApartCount, m.level), m.apart_capacity);
  for (std::uint32_t first = blockIdx.x * kMotionThreads; first < count; first += gridDim.x * kMotionThreads) {
    const bool exists = first + threadIdx.x < count;
    const ApartPair apart = m.apart[exists ? first + threadIdx.x : first];
    const MotionSpan span = m.spans[apart.at.span];
    bool goes_on[2] = {false, false};
    if (exists && !is_hit_before(m, span.motion, apart.at.pair)) {
      const double margin = margin_of(m, apart.at.pair);
      PairAnswer answer;
      answer.status = Status::kOk;
      answer.lower = apart.lower;
      answer.normal = apart.normal;
      MovingPair(m, apart.at, span).divide(answer, margin, {margin, margin}, goes_on);
    }
    list_halves(m, apart.at, span.motion, goes_on);
  }
}

}  // namespace clearance::cuda
