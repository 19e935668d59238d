// Speeds of bodies in a span of a motion, and conclusions from a pair's distance at its middle. Same steps as
// MotionBounds and MotionSearch, with the bounds of engine/motion/motion_step.h.
#pragma once

#include "engine/cuda/pair/hull.cuh"
#include "engine/cuda/pair/least.cuh"
#include "engine/cuda/pair/slack.cuh"
#include "engine/cuda/place/link_frames.cuh"
#include "engine/device/motion_layout.h"

namespace clearance::cuda {

// A motion's joints, by their index in a row of positions.
struct MotionOf {
  const double* ends;
  std::uint32_t joints;

  __device__ MotionOf(const MotionsView& m, std::uint32_t motion)
      : ends(m.ends + std::size_t{motion} * 2 * m.moves.frames.joints), joints(m.moves.frames.joints) {}
  __device__ JointChange joint(std::uint32_t at) const { return joint_change(ends[at], ends[joints + at]); }
};

// LinkFact bits of the joints of a step that the query moves.
__device__ inline std::uint8_t moving_fact_of_step(const KinematicStep& step, const JointRow& row) {
  using Kind = KinematicStep::Kind;
  const std::uint32_t width = step.kind == Kind::kFixed ? 0 : step.kind == Kind::kPlanar ? 3 : 1;
  std::uint8_t fact = 0;
  for (std::uint32_t c = step.column; c < step.column + width; ++c)
    if (row.columns[c].at != kNone) fact |= row.fact(c);
  return fact;
}

// Twists of links relative to their roots.
__device__ inline void store_twist(const MotionsView& m, std::uint32_t frame, std::uint32_t s, const Twist& twist) {
  double* const p = m.twists + std::size_t{frame} * 6 * m.span_capacity + s;
  for (int c = 0; c < 3; ++c) {
    p[std::size_t(c) * m.span_capacity] = twist.turn[c];
    p[std::size_t(3 + c) * m.span_capacity] = twist.shift[c];
  }
}
__device__ inline Twist load_twist(const MotionsView& m, std::uint32_t frame, std::uint32_t s) {
  const double* const p = m.twists + std::size_t{frame} * 6 * m.span_capacity + s;
  Twist twist;
  for (int c = 0; c < 3; ++c) {
    twist.turn[c] = p[std::size_t(c) * m.span_capacity];
    twist.shift[c] = p[std::size_t(3 + c) * m.span_capacity];
  }
  return twist;
}

// A MotionNumber of a moved body in a span.
__device__ inline void set_number(const MotionsView& m, std::uint32_t number, std::uint32_t slot, std::uint32_t s,
                                  double x) {
  m.numbers[(std::size_t{slot} * kMotionNumbers + number) * m.span_capacity + s] = x;
}
__device__ inline double number_of(const MotionsView& m, std::uint32_t number, std::uint32_t slot, std::uint32_t s) {
  return m.numbers[(std::size_t{slot} * kMotionNumbers + number) * m.span_capacity + s];
}
__device__ inline Twist twist_of_slot(const MotionsView& m, std::uint32_t slot, std::uint32_t s) {
  Twist twist;
  for (int c = 0; c < 3; ++c) {
    twist.turn[c] = number_of(m, kOwnTurn + c, slot, s);
    twist.shift[c] = number_of(m, kOwnShift + c, slot, s);
  }
  return twist;
}
__device__ inline PlacedFrame moved_frame(const MotionsView& m, std::uint32_t slot, std::uint32_t s) {
  const BodyPoseRef at(m.chunk.bodies, m.span_capacity, slot | kMovedBit, s);
  return {at.rotation(), at.translation()};
}

// Speed of a chain's points in a motion, and bounds on their position error.
struct ChainMotion {
  MotionRates rates;
  double error = 0, turn_error = 0;
};
__device__ inline MotionRates rates_of_chain(const MotionsView& m, std::uint32_t chain, std::uint32_t motion) {
  if (chain == kNone) return {};
  const MotionChain& c = m.tables.chains[chain];
  const MotionOf of(m, motion);
  const double travel = m.travels[std::size_t{motion} * m.moves.frames.robot_count + c.robot];
  return rates_of_path(
      m.tables.movers + c.first, c.count, [&](std::uint32_t at) { return of.joint(at).change; }, travel, 0);
}
__device__ inline ChainMotion motion_of_chain(const MotionsView& m, std::uint32_t chain, std::uint32_t motion) {
  if (chain == kNone) return {};
  const MotionChain& c = m.tables.chains[chain];
  const MotionOf of(m, motion);
  const double travel = m.travels[std::size_t{motion} * m.moves.frames.robot_count + c.robot];
  const MotionRates rounding = rates_of_path(
      m.tables.movers + c.first, c.count, [&](std::uint32_t at) { return of.joint(at).rounding; }, travel, 0);
  const double placed = placement_error(c.error_fixed, c.error_per_travel, travel);
  return {rates_of_chain(m, chain, motion), (rounding.speed + placed) * kMotionSlack, rounding.turn};
}

// Support value of a body's convex parts along a direction in world axes, from the body's origin.
__device__ __noinline__ inline double reach_of_parts(const HullsView& hulls, std::uint32_t body, const Mat3d& R_wb,
                                                     const Vec3d& n) {
  const Vec3d n_b = R_wb.transpose_times(n);
  const double length = norm(n_b);
  double most = -__builtin_inf();
  for (std::uint32_t i = hulls.part_begin[body]; i < hulls.part_begin[body + 1]; ++i) {
    const HullHead* const head = hulls.heads + hulls.part_hull[i];
    const double reach = support(scene_hull(hulls, head), n_b).value + head->radius * length;
    if (most < reach) most = reach;
  }
  return most;
}

// If the least distance is requested: records a lower bound on the pairs skipped in a span. The order of non-negative
// doubles is that of their bits.
__device__ inline void leave_out(const MotionsView& m, const MotionSpan& span, double low) {
  if (!m.finds_least || span.half() == 0) return;
  take_least(m.low + span.motion, static_cast<std::uint64_t>(__double_as_longlong(low > 0 ? low : 0.0)));
}
// Distances are non-negative, so any proved bound is beyond -inf.
__device__ inline bool is_past(double low, double target) {
  return low > target || target == -__builtin_inf();
}

// A pair at the middle of a span, with bounds on its approach speed.
struct MovingPair {
  const MotionsView& m;
  const SpanPair& item;
  const MotionSpan& span;
  const PairRef ref;
  const BodyPoseRef at_a, at_b;
  PairRates rates;
  double way;  // metres: upper bound on its approach until the ends

  __device__ MovingPair(const MotionsView& view, const SpanPair& of, const MotionSpan& in)
      : m(view),
        item(of),
        span(in),
        ref(view.chunk.pairs[of.pair]),
        at_a(view.chunk.bodies, view.span_capacity, ref.a, of.span),
        at_b(view.chunk.bodies, view.span_capacity, ref.b, of.span) {
    const auto number = [&](std::uint32_t which, std::uint32_t body) {
      return body & kMovedBit ? number_of(m, which, body & ~kMovedBit, item.span) : 0.0;
    };
    rates.speed = number(kOwnSpeed, ref.a) + number(kOwnSpeed, ref.b);
    rates.acceleration = number(kOwnAcceleration, ref.a) + number(kOwnAcceleration, ref.b);
    if (const std::uint32_t at = m.tables.views_of_pair[item.pair]; at != kNone) {
      const MotionViews& views = m.tables.views[at];
#pragma unroll 1
      for (std::uint32_t v = 0; v < views.count; ++v) {
        const MotionViews::View& by = views.view[v];
        rates.see(rates_of_chain(m, by.a, span.motion), rates_of_chain(m, by.b, span.motion), by.seer);
      }
    }
    rates.add_drift(number(kOwnDrift, ref.a) + number(kOwnDrift, ref.b));
    way = way_of_pair(rates, span.half());
  }

  __device__ double inner() const { return pair_slack(m.chunk, ref, item.span).inner; }

  // Lower bound on its distance over the span, along the direction between the boxes, which include the uncertainty of
  // bodies. -inf if not beyond the target.
  __device__ double low_along_boxes(double target) const {
    const Aabb a = at_a.box(), b = at_b.box();
    if (way == 0) return -__builtin_inf();
    const Vec3d n = way_between(a, b), t_a = at_a.translation(), t_b = at_b.translation();
    if (!(norm(n) > target)) return -__builtin_inf();
    const HalfSpans gaps = half_spans(
        n, 0, [&](const Vec3d& d) { return reach_of_box(a, t_a, d); },
        [&](const Vec3d& d) { return reach_of_box(b, t_b, d); }, size_of_box(a, t_a) + size_of_box(b, t_b));
    return gaps.before < gaps.after ? gaps.before : gaps.after;
  }

  // Applies an answer to both halves, as MotionSearch::divide(), and reduces the halves' proved shares. If the answer's
  // status is kBeyond, the pair is beyond `reach` over the whole span.
  // \param targets of both halves
  // \param goes_on set for halves whose proof is not sufficient
  __device__ void divide(const PairAnswer& answer, double reach, const double (&targets)[2], bool (&goes_on)[2]) const {
    const double by_speed = difference_below(answer.lower, way);
    const bool is_beyond = answer.status == Status::kBeyond;
    if (is_beyond || (is_past(by_speed, targets[0]) && is_past(by_speed, targets[1]))) {
      leave_out(m, span, is_beyond && by_speed < reach ? reach : by_speed);
      return;
    }
    if (way == 0) {  // no relative motion, and neither beyond its target nor within
      m.open[span.motion] = 1;
      return;
    }
    HalfSpans gaps{by_speed, by_speed, -__builtin_inf()};
    const Vec3d& n = answer.normal;
    if (answer.lower > 0 && isfinite(n.x + n.y + n.z)) {
      const Mat3d R_wa = at_a.rotation(), R_wb = at_b.rotation();
      const HullsView& hulls = m.chunk.hulls;
      gaps = half_spans(
          n, inner(), [&](const Vec3d& d) { return reach_of_parts(hulls, at_a.body, R_wa, d); },
          [&](const Vec3d& d) { return reach_of_parts(hulls, at_b.body, R_wb, d); },
          m.tables.reach[at_a.body] + m.tables.reach[at_b.body]);
    }
    for (int h = 0; h < 2; ++h) {
      const double target = targets[h], along = h == 0 ? gaps.before : gaps.after,
                   low = along < by_speed ? by_speed : along;
      if (is_past(low, target)) {
        leave_out(m, span, low);
        continue;
      }
      const ProvedShare by_way = proved_until(answer.lower, by_speed, target),
                        by_normal = proved_until(gaps.middle, along, target),
                        most = by_way < by_normal ? by_normal : by_way;
      if (most.share > 0) leave_out(m, span, most.low);
      go_on(h, most.share, goes_on);
    }
  }
  // Goes on with nothing proved of the half before the middle, or of both halves.
  __device__ void go_on_before(bool (&goes_on)[2]) const { go_on(0, 0, goes_on); }
  __device__ void go_on_around(bool (&goes_on)[2]) const {
    for (int h = 0; h < 2; ++h) go_on(h, 0, goes_on);
  }

 private:
  __device__ void go_on(int half, double share, bool (&goes_on)[2]) const {
    atomicMin(m.shares + 2 * item.span + half, __float_as_uint(__double2float_rd(share)));
    goes_on[half] = true;
  }
  template <class ReachA, class ReachB>
  __device__ HalfSpans half_spans(const Vec3d& n, double inner, const ReachA& reach_a, const ReachB& reach_b,
                                  double sizes) const {
    const Vec3d t_a = at_a.translation(), t_b = at_b.translation();
    const HalfSpans gaps = gaps_along(n, t_b - t_a, twist(ref.a, t_a), twist(ref.b, t_b), reach_a, reach_b, sizes,
                                      span.half(), bend_of_pair(rates, span.half()));
    return without_uncertainty(gaps, inner, rates.drift, span.half());
  }
  // Relative to the seer with the least acceleration.
  __device__ Twist twist(std::uint32_t body, const Vec3d& t_w) const {
    const Twist own = body & kMovedBit ? twist_of_slot(m, body & ~kMovedBit, item.span) : Twist{};
    if (rates.seer == kNone) return own;
    const BodyPoseRef seer(m.chunk.bodies, m.span_capacity, rates.seer | kMovedBit, item.span);
    return twist_seen(own, twist_of_slot(m, rates.seer, item.span), t_w - seer.translation());
  }
};

}  // namespace clearance::cuda
