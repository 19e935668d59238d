// What bounds on motion are computed with where hulls meet them: the same text for a CPU and for a GPU thread
// (docs/bounds.md, "Motion").
#pragma once

#include <cmath>

#include "engine/base/slack.h"
#include "engine/hull/box.h"
#include "engine/robot/motion_path_step.h"
#include "wire/types.h"

namespace clearance {

inline constexpr double kMotionUnit = 0x1p-53;
inline constexpr double kTimeUnits = 6;  ///< of q0 + t (q1 - q0) as computed, of the larger of both
/// Of a point's speed, as computed, beside what its place is off.
inline constexpr double kTwistError = 0x1p-40;

/// What one position of a motion does in a unit of time.
struct JointChange {
  double along;     ///< q1 - q0, rounded
  double change;    ///< |q1 - q0|, rounded up
  double rounding;  ///< how far q(t) may be off as computed
};
CLEARANCE_HD inline JointChange joint_change(double q0, double q1) {
  const double along = q1 - q0, s0 = q0 < 0 ? -q0 : q0, s1 = q1 < 0 ? -q1 : q1;
  return {along, (along < 0 ? -along : along) * kMotionSlack,
          q1 != q0 ? kTimeUnits * kMotionUnit * (s0 < s1 ? s1 : s0) * kMotionSlack : 0.0};
}
/// The position at a time, as computed.
CLEARANCE_HD inline double position_at(double q0, double q1, double time) {
  return q0 + time * (q1 - q0);
}

/// How fast what is not known of a body changes while it moves, and how far its twist may be off: metres in a unit of
/// time. \param chain of its points. \param error, turn_error how far they may be put from their places, and what
/// carries them be turned. \param turn_uncertainty radians that the frames behind its slack may be turned by
CLEARANCE_HD inline double drift_of_chain(const MotionRates& chain, double error, double turn_error,
                                          double turn_uncertainty) {
  const double twist_error = kTwistError + 4 * turn_error;
  return (turn_uncertainty + twist_error) * chain.speed + 4 * chain.turn * error;
}

/// How fast two bodies can come nearer, in a unit of time. Rounded up.
struct PairRates {
  double speed = 0;                  ///< metres: no faster does their distance change, nor what is not known of it
  double acceleration = 0;           ///< metres: of points of both together, as `seer` sees them
  std::uint32_t seer = kNone;        ///< a body, whose own twist is taken off; kNone: the world
  std::uint32_t speed_seer = kNone;  ///< likewise: before whose eyes `speed` holds
  double drift = 0;  ///< metres: what is not known of the pair changes so fast, and twists are so far off

  /// Another view of the same pair: each bound holds. \param a, b of both bodies' points, as `by` sees them
  CLEARANCE_HD void see(const MotionRates& a, const MotionRates& b, std::uint32_t by) {
    if (const double seen = a.speed + b.speed; seen < speed) speed = seen, speed_seer = by;
    if (const double seen = a.acceleration + b.acceleration; seen < acceleration) acceleration = seen, seer = by;
  }
  /// Once all views are taken. \param of_both drift_of_chain() of both bodies
  CLEARANCE_HD void add_drift(double of_both) {
    drift = of_both;
    speed = (speed + drift) * kMotionSlack;
  }
};

/// Metres that a pair comes nearer until the ends of a span that is 2 `half` long, at most.
CLEARANCE_HD inline double way_of_pair(const PairRates& rates, double half) {
  return rates.speed > 0 ? sum_above(rates.speed * half, 0x1p-1000) : 0;
}
/// What the points of both are accelerated by makes so much until the ends.
CLEARANCE_HD inline double bend_of_pair(const PairRates& rates, double half) {
  return rates.acceleration * (0.5 * half * half) * (1 + 0x1p-40);
}

/// A body's twist as another one sees it, who is at `away` from it. World axes.
CLEARANCE_HD inline Twist twist_seen(Twist twist, const Twist& seer, const Vec3d& away) {
  twist.shift = twist.shift - (seer.shift + cross(seer.turn, away));
  twist.turn = twist.turn - seer.turn;
  return twist;
}

/// Metres: no nearer are the pieces in the half before the middle, and in the one behind it; and in the middle itself.
/// May be negative. From the middle to an end what is proved is concave in time: no less than on the straight line
/// between the two.
struct HalfSpans {
  double before, after, middle;
};

/// Along one direction, which the seer carries with him: the points of a move linearly but for the bend, so that what
/// it reaches along n at a time s is what it reaches along n + s (n x turn) where it stands, and s n . shift. That is
/// concave in s, as seen from the gap: the ends suffice. \param normal world axes, from a to b, about of length 1.
/// \param D from a's origin to b's. \param reach_a, reach_b how far each reaches along a direction, from its origin.
/// \param sizes of both together. \param half of the span. \param bend bend_of_pair()
template <class ReachA, class ReachB>
CLEARANCE_HD inline HalfSpans gaps_along(const Vec3d& normal, const Vec3d& D, const Twist& a, const Twist& b,
                                         const ReachA& reach_a, const ReachB& reach_b, double sizes, double half,
                                         double bend) {
  constexpr double kRounding = 0x1p-44;  // of all sums below, of the lengths that go into them
  const double length = norm(normal);
  const Vec3d n = normal * (1 / length);
  const Vec3d shift = b.shift - a.shift;
  const Vec3d lean_a = cross(n, a.turn), lean_b = cross(n, b.turn);
  const auto gap = [&](double s) {
    return (dot(n, D) + s * dot(n, shift)) - reach_a(n + lean_a * s) - reach_b(-(n + lean_b * s));
  };
  const double size_a = norm(lean_a), size_b = norm(lean_b), longest = 1 + half * (size_a < size_b ? size_b : size_a);
  const double error = kRounding * (longest * (sizes + norm(D)) + half * (norm(a.shift) + norm(b.shift)));
  const double middle = gap(0);
  const auto least = [&](double end) {
    const double there = gap(end) - bend;
    return (there < middle ? there : middle) - error;
  };
  return {least(-half), least(half), middle - error};
}

/// The same with what is not known of the pair taken off. \param inner of its slack
CLEARANCE_HD inline HalfSpans without_uncertainty(const HalfSpans& gaps, double inner, double drift, double half) {
  const double less = (inner + drift * half) * (1 + 0x1p-40);
  return {difference_below(gaps.before, less), difference_below(gaps.after, less),
          difference_below(gaps.middle, inner * (1 + 0x1p-40))};
}

/// How far a box reaches along a direction from a point, and how large it is from there. World axes.
CLEARANCE_HD inline double reach_of_box(const Aabb& box, const Vec3d& from, const Vec3d& n) {
  const Vec3d low = box.low - from, high = box.high - from;
  const auto more = [](double p, double q) { return p < q ? q : p; };
  return more(n.x * low.x, n.x * high.x) + more(n.y * low.y, n.y * high.y) + more(n.z * low.z, n.z * high.z);
}
CLEARANCE_HD inline double size_of_box(const Aabb& box, const Vec3d& from) {
  return norm(box.low - from) + norm(box.high - from);
}
/// The way from one box to the other, 0 along axes where they overlap.
CLEARANCE_HD inline Vec3d way_between(const Aabb& a, const Aabb& b) {
  Vec3d n{0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const double above = b.low[k] - a.high[k], below = a.low[k] - b.high[k];
    n[k] = (above > 0 ? above : 0.0) - (below > 0 ? below : 0.0);
  }
  return n;
}

/// A share of half a span, from its middle on, in which a pair is no nearer than `low`.
struct ProvedShare {
  double share = 0, low = 0;
  CLEARANCE_HD bool operator<(const ProvedShare& other) const { return share < other.share; }
};
/// How much of the way from a middle to an end keeps a bound of its target that is concave in between: of what is above
/// the target in the middle all but a little may be lost.
CLEARANCE_HD inline ProvedShare proved_until(double middle, double end, double target) {
  const double kept = target + 0x1p-6 * (middle - target);
  if (!(middle > target) || !(end < kept)) return {};
  return {(middle - kept) / (middle - end) * (1 - 0x1p-30), kept < middle ? kept : middle};
}

/// How far all pairs have to be all along, so that an interval of the least distance which ends at `upper` is as narrow
/// as asked, slack aside. Not above 0: it is so whatever they do.
CLEARANCE_HD inline double enough_for(double upper, double abs_tol, double rel_tol, double slack_of_upper,
                                      double slack) {
  const double relative = rel_tol * upper, tolerance = abs_tol < relative ? relative : abs_tol;
  return upper - (tolerance + slack_of_upper + slack);
}

inline constexpr double kContactTime = 0x1p-10;  ///< first contact is narrowed to that, of the motion
/// Whether a span, from its beginning on, has nothing to say of first contact where a pair is within its margin at a
/// time. inf: none is known to be.
CLEARANCE_HD inline bool begins_late(double begin, double hit) {
  return begin > hit - kContactTime;
}

inline constexpr double kSpanGrid = 0x1p-12;         ///< times that spans are cut at
inline constexpr double kLeastTrimmedHalf = 0x1p-7;  ///< half of a span that is cut so: 30 more halves are exact
/// Where the rest of half a span begins, seen from its middle, once all pairs are proved for `proved` of it: such that
/// its middle, and middles of it, are exact. The middle itself: nothing is left out. \param half of the half span
/// \param is_after it comes behind the middle
CLEARANCE_HD inline double rest_of_half(double middle, double proved, double half, bool is_after) {
  if (!(proved > kSpanGrid && half >= kLeastTrimmedHalf)) return middle;
  const double end = is_after ? std::floor((middle + proved) / kSpanGrid) * kSpanGrid
                              : std::ceil((middle - proved) / kSpanGrid) * kSpanGrid;
  return (is_after ? end > middle : end < middle) ? end : middle;
}

}  // namespace clearance
