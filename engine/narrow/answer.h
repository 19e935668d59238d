// The answer for one pair, and the answers that need no search. For host and device.
#pragma once

#include <limits>

#include "engine/base/slack.h"
#include "engine/base/vec.h"
#include "wire/types.h"

namespace clearance {

/// Limits of one pair's search. Lengths in metres; rel_tol is a ratio.
struct NarrowLimits {
  double max_distance = __builtin_inf();
  double abs_tol = 0;
  double rel_tol = 1e-6;  ///< target: upper - lower <= max(abs_tol, rel_tol * |distance|)
  bool signed_distance = false;
  int max_iterations = 256;
  double min_penetration = 0;            ///< penetration to prove instead of the depth itself; metres
  double stop_below = -__builtin_inf();  ///< stop once the upper bound is at most this
};

/// One answer, before it is written to columns. Points are relative to their bodies' origins, in world axes.
struct PairAnswer {
  double distance, lower, upper;
  Status status;
  std::uint16_t flags;
  std::uint32_t part_a, part_b;
  Vec3d point_a, point_b, normal;
};

/// A missing point: NaN in each coordinate.
CLEARANCE_HD inline Vec3d no_point() {
  const double nan = __builtin_nan("");
  return {nan, nan, nan};
}

/// Answer for a pair that cannot be computed: NaN, with bounds -inf and +inf.
CLEARANCE_HD inline PairAnswer no_answer(Status status) {
  return {__builtin_nan(""), -__builtin_inf(), __builtin_inf(), status, 0, kNone, kNone,
          no_point(),        no_point(),       no_point()};
}

/// Answer for a pair without a proof.
CLEARANCE_HD inline PairAnswer unproved_answer() {
  const double infinite = __builtin_inf();
  return {infinite, -infinite, infinite, Status::kUnconverged, 0, kNone, kNone, no_point(), no_point(), no_point()};
}

/// Answer for a pair whose boxes are farther apart than max_distance.
CLEARANCE_HD inline PairAnswer beyond_answer(double lower) {
  return {lower, lower, __builtin_inf(), Status::kBeyond, 0, kNone, kNone, no_point(), no_point(), no_point()};
}

/// Status of a pair from the poses of its bodies. A bad pose comes before a missing one, and that before a stale one.
CLEARANCE_HD inline Status pair_status(Status a, Status b) {
  if (a == Status::kBadPose || b == Status::kBadPose) return Status::kBadPose;
  if (a == Status::kNoPose || b == Status::kNoPose) return Status::kNoPose;
  return a == Status::kStalePose || b == Status::kStalePose ? Status::kStalePose : Status::kOk;
}

/// Answers a pair from its bodies' poses and boxes alone, if they suffice; otherwise sets only the flags.
/// \param gap returns a lower bound on the distance of the boxes; called only if `cull`
template <class Gap>
CLEARANCE_HD inline bool answer_without_parts(Status a, Status b, std::uint16_t flags, bool cull, double max_distance,
                                              const Gap& gap, PairAnswer& answer) {
  answer.flags = flags;
  if (const Status status = pair_status(a, b); status != Status::kOk) {
    answer = no_answer(status);
    answer.flags = flags;
    return true;
  }
  if (!cull) return false;
  const double lower = gap();
  if (!(lower > max_distance)) return false;
  answer = beyond_answer(lower);
  answer.flags = flags;
  return true;
}

/// Whether bounds are as narrow as the arithmetic allows.
CLEARANCE_HD inline bool is_at_rounding(double width, double rounding) {
  return width <= 4 * rounding;
}
/// Absolute tolerance of an interval that does not prove parts apart or overlapping, in metres: no distance becomes a
/// contact because of a wide tolerance.
CLEARANCE_HD inline double contact_tolerance(double abs_tol) {
  constexpr double kMost = 1e-6;
  return abs_tol < kMost ? abs_tol : kMost;
}
/// Width that the query's tolerances allow.
CLEARANCE_HD inline double tolerance_at(double distance, double abs_tol, double rel_tol) {
  const double relative = rel_tol * (distance < 0 ? -distance : distance);
  return abs_tol < relative ? relative : abs_tol;
}
/// Whether the width meets the query's tolerances.
CLEARANCE_HD inline bool is_narrow(double width, double distance, double abs_tol, double rel_tol) {
  return width <= tolerance_at(distance, abs_tol, rel_tol);
}

/// Sets status, bounds and distance of a pair that is proved apart (lower > 0). The caller sets the points.
/// \param narrow whether the bounds meet the tolerance
CLEARANCE_HD inline void decide_apart(double max_distance, double lower, double upper, bool narrow,
                                      PairAnswer& answer) {
  const bool beyond = lower > max_distance;
  answer.status = beyond ? Status::kBeyond : narrow ? Status::kOk : Status::kUnconverged;
  answer.lower = lower;
  answer.upper = upper;
  answer.distance = beyond ? lower : upper;
}
/// Converts bounds on the signed distance of the convex parts into the bodies' status, distance and flags. The only
/// place that does so. Tests the tolerance on the parts' interval, and all else on that of the true bodies.
/// \param rounding returns the width that rounding alone gives the bounds of these parts; called only if needed
/// \param slack of the pair
template <class Rounding>
CLEARANCE_HD inline void decide(const NarrowLimits& limits, double lower, double upper, const Rounding& rounding,
                                PairAnswer& answer, const Slack& slack = {}) {
  double true_lower = slack.true_lower(lower), true_upper = slack.true_upper(upper);
  const bool parts_overlap = upper <= 0, overlap = true_upper <= 0;
  if (!limits.signed_distance) {
    lower = lower < 0 ? 0 : lower;
    upper = parts_overlap ? 0 : upper;
    true_lower = true_lower < 0 ? 0 : true_lower;
    true_upper = overlap ? 0 : true_upper;
  }
  const double width = upper - lower;
  const auto narrow = [&](double distance) { return is_narrow(width, distance, limits.abs_tol, limits.rel_tol); };
  const bool converged = parts_overlap ? !limits.signed_distance || narrow(lower)
                         : lower > 0   ? narrow(upper)
                                       : width <= contact_tolerance(limits.abs_tol);
  if (true_lower > 0) {
    decide_apart(limits.max_distance, true_lower, true_upper, converged, answer);
    if (answer.status == Status::kBeyond) {
      answer.point_a = answer.point_b = no_point();
      return;
    }
  } else {
    answer.lower = true_lower;
    answer.upper = true_upper;
    if (overlap) {
      answer.status = converged ? Status::kOverlap : Status::kUnconverged;
      answer.distance = true_lower;
    } else {
      answer.status = converged || is_at_rounding(width, rounding()) ? Status::kContact : Status::kUnconverged;
      answer.distance = limits.signed_distance ? 0.5 * true_lower + 0.5 * true_upper : true_upper;
    }
  }
  if (!converged && is_at_rounding(width, rounding())) answer.flags |= kFlagRoundingLimited;
  const double size = true_lower > 0 ? true_upper : overlap ? true_lower : 0;
  // Parts may have converged to what slack leaves beyond the tolerance.
  const double of_slack = slack.inner + slack.outer, all = answer.upper - answer.lower;
  if (slack.any() && !(overlap && !limits.signed_distance) &&
      !is_narrow(converged && all > of_slack ? all : of_slack, size, limits.abs_tol, limits.rel_tol))
    answer.flags |= kFlagUncertaintyLimited;
}

}  // namespace clearance
