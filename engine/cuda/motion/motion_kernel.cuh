// Motions of a chunk, level by level: whether all pairs stay beyond their margins. A level evaluates spans at their
// middles; the part of a pair that this does not prove up to both ends goes on in a span of the next level. Same steps
// as engine/motion/motion_search.h, with the bounds of engine/motion/motion_step.h. The number of spans stays on the
// device: kernels read it there, and nothing waits for the host.
//
// If first contact is requested, a pair within its margin ends only the search after it; the part before goes on until
// the time is as narrow as on the CPU. Hits are compared between levels only, so a motion's row does not depend on the
// order of threads. An unresolved pair also goes on: mostly it is deep inside another body and thus after first
// contact. Until a hit confirms that, its motion is left to the CPU.
//
// A motion is also left to the CPU if a list overflows, if the narrow phase leaves a pair unresolved, or if the last
// level does not finish it.
#pragma once

#include "engine/cuda/motion/motion_places.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kMostUnresolvedSteps = 24;
inline constexpr std::uint32_t kEvaluateThreads = 256;  // of a block that evaluates pairs
inline constexpr int kEvaluateBlocks = 2;               // on a multiprocessor, which share its registers
inline constexpr double kRoughMotion = 0.02;            // relative tolerance of a pair's first evaluation
inline constexpr double kFineMotion = 1e-6;  // relative tolerance for deciding on which side of its margin a pair is

// One thread per motion: resets it, and checks the positions at its ends.
__global__ void __launch_bounds__(kMotionThreads) begin_motions(const __grid_constant__ MotionsView m) {
  const std::uint32_t i = thread_index();
  if (i < kMotionCounts) m.counts[i] = i != kSpanCount ? 0 : m.finds_least ? 2 * m.motions : m.motions;
  if (i >= m.motions) return;
  m.hit[i] = kNoHit;
  if (m.seeks_contact) m.free_until[i] = __builtin_inf();
  m.steps[i] = 0;
  m.open[i] = m.unresolved[i] = 0;
  if (m.finds_least)
    begin_at_ends(m, i);
  else
    m.spans[i] = {i, 0, 0, 1, -__builtin_inf()};
  const FramesView& f = m.moves.frames;
  bool is_bad = false;  // a position is invalid
  for (std::uint32_t r = 0; r < f.robot_count; ++r) {
    const JointRobot& robot = f.robots[r];
    double travel = 0;
    for (std::uint32_t end = 0; end < 2; ++end) {
      const JointRow row{f.columns + robot.first_column, m.ends + (std::size_t{i} * 2 + end) * f.joints};
      for (std::uint32_t s = 0; s < robot.steps; ++s) {
        const KinematicStep& step = f.steps[robot.first_step + s];
        is_bad |= (moving_fact_of_step(step, row) & kLinkBad) != 0;
        const double out = travel_of(step, row);
        if (travel < out) travel = out;
      }
    }
    m.travels[std::size_t{i} * f.robot_count + r] = travel;
  }
  m.to_cpu[i] = is_bad;
}

// Whether the boxes prove that a pair stays beyond its target, however the bodies move.
__device__ inline bool leaves_by_boxes(const MotionsView& m, PairRef ref, std::uint32_t pair, std::uint32_t s,
                                       const MotionSpan& span) {
  const auto [a, b] = boxes_of(m.chunk, ref, s);
  if (is_empty(a) || is_empty(b)) {  // without a usable pose
    m.to_cpu[span.motion] = 1;
    return true;
  }
  const auto speed = [&](std::uint32_t body) -> double {
    return body & kMovedBit ? m.speeds[std::size_t{body & ~kMovedBit} * m.span_capacity + s] : 0;
  };
  const double low =
      difference_below(gap_below(a, b), sum_above(speed(ref.a), speed(ref.b)) * span.half() * (1 + 0x1p-50));
  if (!is_past(low, target_of(m, span, pair, 0))) return false;
  leave_out(m, span, low);
  return true;
}

// Lists the pairs that boxes do not exclude. The first level has all pairs of all spans, with those of one pair
// consecutive; later levels have the pairs that go on.
template <bool kFirst>
__global__ void __launch_bounds__(kMotionThreads) find_near_in_spans(const __grid_constant__ MotionsView m) {
  const std::uint32_t spans = span_count(m);
  const std::uint64_t count =
      kFirst ? std::uint64_t{spans} * m.chunk.pair_count : listed(count_of(m, kOnCount, m.level - 1), m.pair_capacity);
  for (std::uint64_t first = std::uint64_t{blockIdx.x} * kMotionThreads; first < count;
       first += std::uint64_t{gridDim.x} * kMotionThreads) {
    const std::uint64_t i = first + threadIdx.x;
    bool wanted = i < count;
    SpanPair item{0, 0};
    MotionSpan span{};
    if (wanted && kFirst) {
      item = {static_cast<std::uint32_t>(i % spans), static_cast<std::uint32_t>(i / spans)};
    } else if (wanted) {
      const SpanPair on = m.on[i];
      item = {m.children[2 * on.span + (on.pair & 1)], on.pair >> 1};
      wanted = item.span != kNone;
    }
    if (wanted) {
      span = m.spans[item.span];
      wanted = !leaves_by_boxes(m, m.chunk.pairs[item.pair], item.pair, item.span, span);
    }
    const std::uint32_t at = take_place_of_block<kMotionThreads>(&count_of(m, kNearCount, m.level), wanted);
    if (!wanted) continue;
    if (at < m.pair_capacity)
      m.near[at] = item;
    else
      m.open[span.motion] = 1;
  }
}

// Lists those of them that may come within their target along the direction between the boxes.
__global__ void __launch_bounds__(kMotionThreads) look_along_boxes(const __grid_constant__ MotionsView m) {
  const std::uint32_t count = listed(count_of(m, kNearCount, m.level), m.pair_capacity);
  for (std::uint32_t first = blockIdx.x * kMotionThreads; first < count; first += gridDim.x * kMotionThreads) {
    bool wanted = first + threadIdx.x < count;
    SpanPair item{0, 0};
    MotionSpan span{};
    float way = 0;
    if (wanted) {
      item = m.near[first + threadIdx.x];
      span = m.spans[item.span];
      const MovingPair pair(m, item, span);
      const double target = target_of(m, span, item.pair, 0), low = pair.low_along_boxes(target);
      wanted = !(low > target);
      way = __double2float_ru(pair.way);
      if (!wanted) leave_out(m, span, low);
    }
    const std::uint32_t at = take_place_of_block<kMotionThreads>(&count_of(m, kEvaluateCount, m.level), wanted);
    if (!wanted) continue;
    if (at < m.pair_capacity) {
      m.to_evaluate[at] = item;
      if (!m.finds_least) m.ways[at] = way;
    } else {
      m.open[span.motion] = 1;
    }
  }
}

// Records a pair within its margin.
__device__ inline void add_hit(const MotionsView& m, const SpanPair& item, const MovingPair& pair,
                               const PairAnswer& answer) {
  const MotionSpan& span = pair.span;
  const double time = pair.way > 0 ? span.middle() : span.begin;  // without relative motion, it is there from the start
  const std::uint64_t key = hit_key(m, item.pair, time);
  if (__ldcg(m.hit + span.motion) < key) return;
  const std::uint32_t at = atomicAdd(&count_of(m, kHitCount, m.level), 1);
  if (at >= m.hit_capacity) {
    m.to_cpu[span.motion] = 1;
    return;
  }
  m.hits[at] = {key, span.motion, item.pair, time, pair.at_a.translation(), pair.at_b.translation(), answer, 0, 0, 0};
  take_least(m.hit + span.motion, key);
}

// Evaluates a pair at the middle of its span.
// \param target distance beyond which it need not be known
template <bool kLeast>
__device__ __forceinline__ PairOutcome evaluate_at_middle(const MotionsView& m, const SpanPair& item,
                                                          const MovingPair& pair, double margin, double target,
                                                          PairAnswer& answer) {
  const ChunkView& c = m.chunk;
  const MotionSpan& span = pair.span;
  // Whether only the side of the margin is needed.
  const bool decides = !kLeast || span.required_distance == -__builtin_inf();
  PairLimits q = c.pair_limits;
  q.max_distance = sum_above(target, pair.way);
  // A rough evaluation mostly decides the side of the margin. The tolerances of the least distance are too wide for
  // that: pairs nearly in contact would go on to the last level.
  const double wanted = kLeast ? kFineMotion : q.rel_tol;
  if (decides) q.rel_tol = wanted < kRoughMotion ? kRoughMotion : wanted;
  if (kLeast && decides) q.abs_tol = 0;
#pragma unroll 1
  for (bool again = false;; again = true) {
    const PairOutcome outcome = evaluate_at_margin<Slack>(c, q, decides ? margin : -__builtin_inf(), pair.ref,
                                                          item.span, pair.at_a, pair.at_b, answer);
    const bool is_unsure = outcome == PairOutcome::kConverged && answer.lower <= margin && answer.upper > margin &&
                           !span.late && (kLeast || q.rel_tol > wanted);
    if (again || !is_unsure) return outcome;
    q.rel_tol = wanted;
    if (kLeast) q.abs_tol = 0;
  }
}

// Applies the outcome at the middle of a span to its motion, and finds the halves in which the pair goes on.
template <bool kLeast>
__device__ __forceinline__ void apply_outcome(const MotionsView& m, const SpanPair& item, const MovingPair& pair,
                                              double target, PairOutcome outcome, const PairAnswer& answer,
                                              bool (&goes_on)[2]) {
  const MotionSpan& span = pair.span;
  if (outcome == PairOutcome::kUnresolved && kLeast && span.half() == 0) {
    // spans with a length evaluate the pair again
  } else if (outcome == PairOutcome::kUnresolved && m.seeks_contact) {
    m.unresolved[span.motion] = 1;
    pair.go_on_around(goes_on);
  } else if (outcome == PairOutcome::kUnresolved) {
    m.open[span.motion] = 1;
  } else if (kLeast) {
    update_least(m, pair, target, answer, goes_on);
  } else if (answer.upper <= target) {
    add_hit(m, item, pair, answer);
    if (m.seeks_contact && pair.way > 0) pair.go_on_before(goes_on);
  } else {
    pair.divide(answer, target, {target, target}, goes_on);
  }
}

// Lists the halves of a span in which a pair goes on. All threads of the warp call it.
__device__ inline void list_halves(const MotionsView& m, const SpanPair& item, std::uint32_t motion,
                                   const bool (&goes_on)[2]) {
  for (std::uint32_t h = 0; h < 2; ++h) {
    const std::uint32_t at = take_place(&count_of(m, kOnCount, m.level), goes_on[h]);
    if (!goes_on[h]) continue;
    if (at < m.pair_capacity)
      m.next_on[at] = {item.span, 2 * item.pair + h};
    else
      m.open[motion] = 1;
  }
}

// Evaluates the pairs that motion_lean.cuh leaves, or all if the least distance is requested, one per thread, and lists
// the halves of the span in which each goes on.
// The barriers keep the warps of a block in one phase: its code does not fit the instruction cache as a whole.
template <bool kLeast>
__global__ void __launch_bounds__(kEvaluateThreads, kEvaluateBlocks)
    evaluate_span_pairs(const __grid_constant__ MotionsView m) {
  const std::uint32_t count = listed(count_of(m, kLeast ? kEvaluateCount : kLaterCount, m.level), m.pair_capacity);
  const SpanPair* const items = kLeast ? m.to_evaluate : m.near;
  for (std::uint32_t first = blockIdx.x * kEvaluateThreads; first < count; first += gridDim.x * kEvaluateThreads) {
    const bool exists = first + threadIdx.x < count;
    const SpanPair item = items[exists ? first + threadIdx.x : first];  // threads without a pair repeat the first
    const MovingPair pair(m, item, m.spans[item.span]);
    const std::uint32_t motion = pair.span.motion;
    const bool wanted = exists && !is_hit_before(m, motion, item.pair);
    const double margin = margin_of(m, item.pair),
                 target = kLeast ? target_of(m, pair.span, item.pair, pair.inner()) : margin;
    PairAnswer answer = beyond_answer(0);
    PairOutcome outcome = PairOutcome::kWithoutParts;
    bool goes_on[2] = {false, false};
    __syncthreads();
    if (wanted) outcome = evaluate_at_middle<kLeast>(m, item, pair, margin, target, answer);
    __syncthreads();
    if (wanted) apply_outcome<kLeast>(m, item, pair, target, outcome, answer, goes_on);
    __syncthreads();
    add_count(m.counts + kConvergedCount, wanted && outcome == PairOutcome::kConverged);
    list_halves(m, item, motion, goes_on);
  }
}

// Keeps the best hit of each motion, to free the list for the next level.
__global__ void __launch_bounds__(kMotionThreads) keep_hits(const __grid_constant__ MotionsView m) {
  const std::uint32_t count = listed(count_of(m, kHitCount, m.level), m.hit_capacity);
  for (std::uint32_t i = blockIdx.x * kMotionThreads + threadIdx.x; i < count; i += gridDim.x * kMotionThreads) {
    const MotionHitRow& hit = m.hits[i];
    if (hit.key == m.hit[hit.motion]) m.best[hit.motion] = hit;
  }
}

// Whether unresolved pairs would multiply spans: the motion has no hit, or many spans already.
__device__ inline bool would_multiply_spans(const MotionsView& m, std::uint32_t motion) {
  return m.unresolved[motion] && (m.hit[motion] == kNoHit || m.steps[motion] > kMostUnresolvedSteps);
}

// Unproved rest of half a span.
// \param share of the half, from the middle on, that is proved for all pairs
__device__ inline MotionSpan rest_of_span(const MotionSpan& span, bool is_after, float share) {
  const double middle = span.middle(), proved = static_cast<double>(share) * span.half();
  const double rest = rest_of_half(middle, proved, 0.5 * span.half(), is_after);
  return {span.motion, span.late, is_after ? rest : span.begin, is_after ? span.end : rest, span.required_distance};
}

// One thread per half of each span: its unproved rest becomes a span of the next level.
__global__ void __launch_bounds__(kMotionThreads) divide_spans(const __grid_constant__ MotionsView m) {
  const std::uint32_t i = thread_index(), s = i / 2;
  bool wanted = s < span_count(m);
  MotionSpan span{};
  if (wanted) {
    span = m.spans[s];
    m.next_children[i] = kNone;
    const bool is_decided = !m.seeks_contact && m.hit[span.motion] != kNoHit;
    wanted = m.shares[i] != ~0u && !is_decided && !m.open[span.motion] && !m.to_cpu[span.motion];
  }
  if (wanted) {
    span = rest_of_span(span, i % 2 == 1, __uint_as_float(m.shares[i]));
    if (m.finds_least && !is_still_needed(m, span)) {
      wanted = false;
    } else if (!m.finds_least && m.seeks_contact && begins_late(span.begin, time_of_hit(m, span.motion))) {
      free_no_longer(m, span.motion, span.begin);
      wanted = false;
    } else if (m.level + 1 == m.levels || would_multiply_spans(m, span.motion)) {
      m.open[span.motion] = 1;
      wanted = false;
    }
  }
  const std::uint32_t at = take_place(&count_of(m, kSpanCount, m.level + 1), wanted);
  if (!wanted) return;
  if (at >= m.span_capacity) {
    m.open[span.motion] = 1;
    return;
  }
  m.next_spans[at] = span;
  m.next_children[i] = at;
}

// Decides each motion, and writes the rows of those that hit.
__global__ void __launch_bounds__(kMotionThreads) conclude_motions(const __grid_constant__ MotionsView m) {
  const std::uint32_t i = thread_index();
  bool has_row = false;
  if (i < m.motions) {
    const bool is_hit = m.hit[i] != kNoHit;
    const bool matters = m.finds_least || m.seeks_contact || !is_hit;  // whether unproved parts matter
    const bool is_open = m.to_cpu[i] != 0 || (matters && m.open[i] != 0) || m.steps[i] > m.max_evaluations ||
                         (m.finds_least && !has_least(m, i));
    has_row = (is_hit || m.finds_least) && !is_open;
    m.outcomes[i] = is_open ? MotionOutcome::kOpen : has_row ? MotionOutcome::kHit : MotionOutcome::kFree;
    if (m.seeks_contact && is_hit) free_no_longer(m, i, time_of_hit(m, i));
  }
  const std::uint32_t at = take_place(m.counts + kHitRowCount, has_row);
  if (!has_row) return;
  m.hit_rows[at] = m.best[i];
  if (m.finds_least) complete_least(m, i, m.hit_rows[at]);
}

}  // namespace clearance::cuda
