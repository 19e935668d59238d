// Arithmetic of bounds on motion for convex parts: same source for the CPU and for a GPU thread
// (docs/trust/bounds_robots.md, "Motion").
#pragma once

#include <cmath>

#include "engine/base/slack.h"
#include "engine/hull/box.h"
#include "engine/robot/motion_path_step.h"
#include "wire/types.h"

namespace clearance {

inline constexpr double kMotionUnit = 0x1p-53;
inline constexpr double kTimeUnits = 6;  ///< error of q0 + t (q1 - q0) as computed, in roundings of the larger
/// Relative error of a point's speed as computed, in addition to that of its position.
inline constexpr double kTwistError = 0x1p-40;

/// Change of one joint position of a motion, per unit of time.
struct JointChange {
  double along;     ///< q1 - q0, rounded
  double change;    ///< |q1 - q0|, rounded up
  double rounding;  ///< bound on the error of q(t) as computed
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

/// Bound on the rate at which a body's uncertainty changes while it moves, plus the error of its twist, in metres per
/// unit of time.
/// \param chain rates of its points
/// \param error, turn_error bounds on the displacement of the points and on the rotation of their carrier
/// \param turn_uncertainty radians by which the frames behind its slack may be rotated
CLEARANCE_HD inline double drift_of_chain(const MotionRates& chain, double error, double turn_error,
                                          double turn_uncertainty) {
  const double twist_error = kTwistError + 4 * turn_error;
  return (turn_uncertainty + twist_error) * chain.speed + 4 * chain.turn * error;
}

/// Bounds on the rates at which two bodies can approach, per unit of time. Rounded up.
struct PairRates {
  double speed = 0;                  ///< metres: bounds the change of their distance, and of its uncertainty
  double acceleration = 0;           ///< metres: of points of both together, relative to `seer`
  std::uint32_t seer = kNone;        ///< the reference body, whose own twist is subtracted; kNone is the world
  std::uint32_t speed_seer = kNone;  ///< likewise, for `speed`
  double drift = 0;  ///< metres: bounds the change of the pair's uncertainty, plus the error of the twists

  /// Adds another view of the same pair; the bounds of each view hold.
  /// \param a, b rates of both bodies' points relative to `by`
  CLEARANCE_HD void see(const MotionRates& a, const MotionRates& b, std::uint32_t by) {
    if (const double seen = a.speed + b.speed; seen < speed) speed = seen, speed_seer = by;
    if (const double seen = a.acceleration + b.acceleration; seen < acceleration) acceleration = seen, seer = by;
  }
  /// Call after all views are added.
  /// \param of_both sum of drift_of_chain() of both bodies
  CLEARANCE_HD void add_drift(double of_both) {
    drift = of_both;
    speed = (speed + drift) * kMotionSlack;
  }
};

/// Upper bound on how much nearer a pair comes until the ends of a span of length 2 `half`, in metres.
CLEARANCE_HD inline double way_of_pair(const PairRates& rates, double half) {
  return rates.speed > 0 ? sum_above(rates.speed * half, 0x1p-1000) : 0;
}
/// Upper bound on the displacement by the acceleration of both bodies' points until the ends.
CLEARANCE_HD inline double bend_of_pair(const PairRates& rates, double half) {
  return rates.acceleration * (0.5 * half * half) * (1 + 0x1p-40);
}

/// Twist of a body relative to a reference body. World axes.
/// \param away from the reference body's origin to the body's
CLEARANCE_HD inline Twist twist_seen(Twist twist, const Twist& seer, const Vec3d& away) {
  twist.shift = twist.shift - (seer.shift + cross(seer.turn, away));
  twist.turn = twist.turn - seer.turn;
  return twist;
}

/// Lower bounds on the distance of two parts in the half before the middle, in the one after it, and in the middle
/// itself, in metres. They may be negative. From the middle to an end the proved bound is concave in time: at least the
/// linear interpolation of the two.
struct HalfSpans {
  double before, after, middle;
};

/// Bounds along one direction, which is fixed to the reference body. The points of a body move linearly up to `bend`,
/// so its support along n at time s is its support along n + s (n x turn) at the middle, plus s n . shift. The gap is
/// concave in s, so that its ends suffice.
/// \param normal world axes, from a to b, length about 1
/// \param D from a's origin to b's
/// \param reach_a, reach_b support of each body along a direction, from its origin
/// \param sizes sum of both sizes
/// \param half half of the span
/// \param bend bend_of_pair()
template <class ReachA, class ReachB>
CLEARANCE_HD inline HalfSpans gaps_along(const Vec3d& normal, const Vec3d& D, const Twist& a, const Twist& b,
                                         const ReachA& reach_a, const ReachB& reach_b, double sizes, double half,
                                         double bend) {
  constexpr double kRounding = 0x1p-44;  // of all sums below, relative to the lengths in them
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

/// The same bounds, with the pair's uncertainty subtracted.
/// \param inner of its slack
CLEARANCE_HD inline HalfSpans without_uncertainty(const HalfSpans& gaps, double inner, double drift, double half) {
  const double less = (inner + drift * half) * (1 + 0x1p-40);
  return {difference_below(gaps.before, less), difference_below(gaps.after, less),
          difference_below(gaps.middle, inner * (1 + 0x1p-40))};
}

/// Support of a box along a direction from a point, and the box's size seen from there. World axes.
CLEARANCE_HD inline double reach_of_box(const Aabb& box, const Vec3d& from, const Vec3d& n) {
  const Vec3d low = box.low - from, high = box.high - from;
  const auto more = [](double p, double q) { return p < q ? q : p; };
  return more(n.x * low.x, n.x * high.x) + more(n.y * low.y, n.y * high.y) + more(n.z * low.z, n.z * high.z);
}
CLEARANCE_HD inline double size_of_box(const Aabb& box, const Vec3d& from) {
  return norm(box.low - from) + norm(box.high - from);
}
/// Shortest vector from one box to the other; zero along axes on which they overlap.
CLEARANCE_HD inline Vec3d way_between(const Aabb& a, const Aabb& b) {
  Vec3d n{0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const double above = b.low[k] - a.high[k], below = a.low[k] - b.high[k];
    n[k] = (above > 0 ? above : 0.0) - (below > 0 ? below : 0.0);
  }
  return n;
}

/// A share of half a span, from its middle on, in which `low` is a lower bound of the pair's distance.
struct ProvedShare {
  double share = 0, low = 0;
  CLEARANCE_HD bool operator<(const ProvedShare& other) const { return share < other.share; }
};
/// Share of the way from a middle to an end in which a bound that is concave in between stays above its target. All but
/// a small part of its excess in the middle may be lost.
CLEARANCE_HD inline ProvedShare proved_until(double middle, double end, double target) {
  const double kept = target + 0x1p-6 * (middle - target);
  if (!(middle > target) || !(end < kept)) return {};
  return {(middle - kept) / (middle - end) * (1 - 0x1p-30), kept < middle ? kept : middle};
}

/// Lower bound that all pairs must keep throughout, so that an interval of the least distance with the upper end
/// `upper` is within tolerance, apart from slack. At or below 0 the interval is within tolerance in any case.
CLEARANCE_HD inline double required_distance_for(double upper, double abs_tol, double rel_tol, double slack_of_upper,
                                                 double slack) {
  const double relative = rel_tol * upper, tolerance = abs_tol < relative ? relative : abs_tol;
  return upper - (tolerance + slack_of_upper + slack);
}

inline constexpr double kContactTime = 0x1p-10;  ///< resolution of first contact, as a share of the motion
/// Returns whether a span begins too late to affect first contact, given a time at which a pair is within its margin,
/// or inf if no such time is known.
CLEARANCE_HD inline bool begins_late(double begin, double hit) {
  return begin > hit - kContactTime;
}

inline constexpr double kSpanGrid = 0x1p-12;         ///< grid of the times at which spans are cut
inline constexpr double kLeastTrimmedHalf = 0x1p-7;  ///< smallest half that is cut; 30 more halvings are exact
/// Start of the remainder of half a span, seen from its middle, after all pairs are proved for time `proved`. Its
/// middle and the middles of its halves are exact. Returns the middle itself if nothing can be cut.
/// \param half half of the half span
/// \param is_after whether the half span follows the middle
CLEARANCE_HD inline double rest_of_half(double middle, double proved, double half, bool is_after) {
  if (!(proved > kSpanGrid && half >= kLeastTrimmedHalf)) return middle;
  const double end = is_after ? std::floor((middle + proved) / kSpanGrid) * kSpanGrid
                              : std::ceil((middle - proved) / kSpanGrid) * kSpanGrid;
  return (is_after ? end > middle : end < middle) ? end : middle;
}

}  // namespace clearance
