// The least distance of motions, in addition to first contact: the parts of motion_kernel.cuh's levels that only it
// needs.
//
// The first level evaluates both ends, since the least distance is mostly there and halving would approach it slowly.
// After each level its results set the required distance of pairs in the next one (MotionSpan::required_distance), and spans
// that need nothing more are dropped. Within a level no thread reads other threads' results, so rows do not depend on
// their order.
#pragma once

#include "engine/cuda/motion/motion_marks.cuh"
#include "engine/cuda/pair/items.cuh"
#include "engine/cuda/pair/margin_pair.cuh"
#include "engine/cuda/pair/outer_box.cuh"

namespace clearance::cuda {

__device__ inline bool has_least(const MotionsView& m, std::uint32_t motion) {
  return m.best[motion].answer.upper < __builtin_inf();
}

// Required distance of all pairs, given one with this upper bound. -inf if the bounds suffice already, inf if no bound
// is known.
__device__ inline double required_distance_of(const MotionsView& m, double upper, double slack) {
  if (!(upper < __builtin_inf())) return upper;
  const double required_distance = required_distance_for(upper, m.abs_tol, m.rel_tol, slack, 0);
  return upper > 0 && required_distance > 0 ? required_distance : -__builtin_inf();
}

// Resets a motion; its ends are evaluated first.
__device__ inline void begin_at_ends(const MotionsView& m, std::uint32_t motion) {
  m.best[motion].answer.upper = __builtin_inf();
  m.low[motion] = static_cast<std::uint64_t>(__double_as_longlong(__builtin_inf()));
  m.lock[motion] = 0;
  for (std::uint32_t end = 0; end < 2; ++end) {
    const double time = end;
    m.seed[2 * motion + end] = ~std::uint64_t{0};
    m.spans[2 * motion + end] = {motion, !m.seeks_contact, time, time, __builtin_inf()};
  }
}

// Called between levels: sets the requirements of a span. Returns false if it needs nothing more and is dropped.
__device__ inline bool is_still_needed(const MotionsView& m, MotionSpan& span) {
  const MotionHitRow& best = m.best[span.motion];
  span.required_distance = required_distance_of(m, best.answer.upper, best.slack);
  span.late = !m.seeks_contact || begins_late(span.begin, time_of_hit(m, span.motion));
  if (m.seeks_contact && span.late) free_no_longer(m, span.motion, span.begin);
  if (!span.late || span.required_distance > 0) return true;
  leave_out(m, span, 0);
  return false;
}

// Order by which one row is chosen to represent a motion.
__device__ inline bool goes_before(const MotionHitRow& p, const MotionHitRow& q) {
  if (p.answer.upper != q.answer.upper) return p.answer.upper < q.answer.upper;
  return p.time != q.time ? p.time < q.time : p.pair < q.pair;
}
// Records the distance of a pair at a time. The final row does not depend on the order of threads.
__device__ inline void take_nearest(const MotionsView& m, const MotionHitRow& row) {
  MotionHitRow& best = m.best[row.motion];
  if (!(row.answer.upper < __builtin_inf()) || row.answer.upper > __ldcg(&best.answer.upper)) return;
  for (bool done = false; !done;) {
    if (atomicExch(m.lock + row.motion, 1u) != 0) continue;
    __threadfence();
    if (goes_before(row, best)) best = row;
    __threadfence();
    atomicExch(m.lock + row.motion, 0u);
    done = true;
  }
}
__device__ inline MotionHitRow row_of(const MotionsView& m, const MovingPair& pair, const PairAnswer& answer) {
  const MotionSpan& span = pair.span;
  const double time = pair.way > 0 ? span.middle() : span.begin;  // without relative motion, it is there from the start
  return {hit_key(m, pair.item.pair, time),
          span.motion,
          pair.item.pair,
          time,
          pair.at_a.translation(),
          pair.at_b.translation(),
          answer,
          slack_of_pair(m.chunk, pair.ref, pair.item.span).outer,
          0,
          0};
}

// Applies an answer to the least distance, to first contact, and to both halves of a span.
// \param reach distance up to which the pair was evaluated, in metres
__device__ inline void update_least(const MotionsView& m, const MovingPair& pair, double reach,
                                    const PairAnswer& answer, bool (&goes_on)[2]) {
  const MotionSpan& span = pair.span;
  const double margin = margin_of(m, pair.item.pair);
  const bool is_within = answer.upper <= margin;
  const MotionHitRow row = row_of(m, pair, answer);
  take_nearest(m, row);
  if (!span.late && is_within) take_least(m.hit + span.motion, row.key);
  if (span.half() == 0) return;
  // This pair's bounds need not be narrower than its own answer requires.
  const double own = required_distance_of(m, answer.upper, row.slack),
               least = own < span.required_distance ? own : span.required_distance;
  const double required_distance = least - pair.inner(), free = margin < required_distance ? required_distance : margin;
  // First contact is not sought after a pair within its margin, nor before it if it does not move.
  const bool before = !span.late && !(is_within && pair.way == 0), behind = !span.late && !is_within;
  pair.divide(answer, reach, {before ? free : required_distance, behind ? free : required_distance}, goes_on);
}

// Finds at each end the pair with the nearest boxes; any pair would do. Pairs without usable poses are left to the CPU.
__global__ void __launch_bounds__(kMotionThreads) find_seeds_at_ends(const __grid_constant__ MotionsView m) {
  const std::uint32_t spans = span_count(m);
  const std::uint64_t count = std::uint64_t{spans} * m.chunk.pair_count;
  for (std::uint64_t i = std::uint64_t{blockIdx.x} * kMotionThreads + threadIdx.x; i < count;
       i += std::uint64_t{gridDim.x} * kMotionThreads) {
    const auto s = static_cast<std::uint32_t>(i % spans), pair = static_cast<std::uint32_t>(i / spans);
    const PairRef ref = m.chunk.pairs[pair];
    const auto [a, b] = boxes_of(m.chunk, ref, s);
    if (is_empty(a) || is_empty(b)) continue;
    take_least(m.seed + s, std::uint64_t{order_key(gap_below(a, b))} << 32 | pair);
  }
}

// Evaluates these pairs, one thread per end, so that few other pairs need evaluation.
__global__ void __launch_bounds__(kMotionThreads) evaluate_seeds(const __grid_constant__ MotionsView m) {
  const std::uint32_t s = thread_index();
  if (s >= span_count(m) || m.seed[s] == ~std::uint64_t{0}) return;
  const SpanPair item{s, static_cast<std::uint32_t>(m.seed[s])};
  const MotionSpan span = m.spans[s];
  const MovingPair pair(m, item, span);
  PairAnswer answer = beyond_answer(0);
  if (evaluate_at_margin<Slack>(m.chunk, m.chunk.pair_limits, -__builtin_inf(), pair.ref, s, pair.at_a, pair.at_b,
                                answer) == PairOutcome::kConverged)
    take_nearest(m, row_of(m, pair, answer));
}
// Runs after evaluate_seeds(): sets the required distance of other pairs there.
__global__ void __launch_bounds__(kMotionThreads) aim_at_ends(const __grid_constant__ MotionsView m) {
  const std::uint32_t s = thread_index();
  if (s >= span_count(m)) return;
  const MotionHitRow& best = m.best[m.spans[s].motion];
  m.spans[s].required_distance = required_distance_of(m, best.answer.upper, best.slack);
}

// Runs after both ends: whole motions become the spans of the next level.
__global__ void __launch_bounds__(kMotionThreads) begin_whole_motions(const __grid_constant__ MotionsView m) {
  const std::uint32_t i = thread_index();
  MotionSpan span{i, 0, 0, 1, 0};
  const bool wanted = i < m.motions && !m.open[i] && !m.to_cpu[i] && is_still_needed(m, span);
  const std::uint32_t at = take_place(&count_of(m, kSpanCount, m.level + 1), wanted);
  if (wanted) m.next_spans[at] = span;
}

// Adds the remaining results of a motion to its nearest pair's row, after all levels.
__device__ inline void complete_least(const MotionsView& m, std::uint32_t motion, MotionHitRow& row) {
  row.low = __longlong_as_double(static_cast<long long>(m.low[motion]));
  row.contact = time_of_hit(m, motion);
}

}  // namespace clearance::cuda
