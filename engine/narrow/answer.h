// One pair's answer, and how the simple ones are made. For host and device.
#pragma once

#include <limits>

#include "wire/types.h"
#include "engine/base/vec.h"

namespace clearance {

/// One answer, before it is written into columns. Points are relative to their bodies' origins, world axes.
struct PairAnswer {
  double distance, lower, upper;
  Status status;
  std::uint16_t flags;
  std::uint32_t piece_a, piece_b;
  Vec3d point_a, point_b, normal;
};

/// NaN in each coordinate: no such point.
CLEARANCE_HD inline Vec3d no_point() {
  const double nan = __builtin_nan("");
  return {nan, nan, nan};
}

/// The answer for a pair that cannot be computed: NaN, with bounds -inf and +inf.
CLEARANCE_HD inline PairAnswer no_answer(Status status) {
  return {__builtin_nan(""), -__builtin_inf(), __builtin_inf(), status, 0, kNone, kNone,
          no_point(),        no_point(),       no_point()};
}

/// The answer for a pair of which nothing could be proved.
CLEARANCE_HD inline PairAnswer unproved_answer() {
  const double infinite = __builtin_inf();
  return {infinite, -infinite, infinite, Status::kUnconverged, 0, kNone, kNone, no_point(), no_point(), no_point()};
}

/// The answer for a pair whose boxes are farther apart than max_distance.
CLEARANCE_HD inline PairAnswer beyond_answer(double lower) {
  return {lower, lower, __builtin_inf(), Status::kBeyond, 0, kNone, kNone, no_point(), no_point(), no_point()};
}

/// What the poses of two bodies say of their pair: a bad one, then a missing one, else kOk.
CLEARANCE_HD inline Status pair_status(Status a, Status b) {
  if (a == Status::kBadPose || b == Status::kBadPose) return Status::kBadPose;
  return a == Status::kNoPose || b == Status::kNoPose ? Status::kNoPose : Status::kOk;
}

/// The answer for a group without pairs: farther than anything.
CLEARANCE_HD inline PairAnswer empty_answer() {
  const double infinite = __builtin_inf();
  return {infinite, infinite, infinite, Status::kBeyond, 0, kNone, kNone, no_point(), no_point(), no_point()};
}

/// What an answer adds to the lower bound of its group, where a group's far pairs are left out by their boxes' gap: a pair
/// that is looked at nevertheless must add no less than its gap, unless nothing could be proved of it.
/// \param lower of the answer; \param gap 0: the boxes touch
CLEARANCE_HD inline double lower_with_box(double lower, double gap) {
  return gap > 0 && gap > lower && lower > -__builtin_inf() ? gap : lower;
}

/// A group's winner has the least upper bound, then this, then the first place: among pairs that boxes alone prove to be
/// beyond max_distance, the least gap.
CLEARANCE_HD inline double nearest_beyond(const PairAnswer& answer) {
  return answer.upper == __builtin_inf() ? answer.lower : 0;
}

/// Makes the winner's answer its group's: the interval reaches down to the group's least lower bound.
CLEARANCE_HD inline void widen_to_group(PairAnswer& answer, double lower, double max_distance, double abs_tol,
                                        double rel_tol) {
  if (answer.distance != answer.distance) return;  // no pair of the group has usable poses
  if (lower < answer.lower) answer.lower = lower;
  const double relative = rel_tol * (answer.upper < 0 ? -answer.upper : answer.upper);
  const double wanted = abs_tol < relative ? relative : abs_tol;
  if (answer.status == Status::kOk && !(answer.upper - answer.lower <= wanted)) answer.status = Status::kUnconverged;
  if (answer.status != Status::kBeyond) return;
  const bool is_beyond = answer.lower > max_distance;
  if (!is_beyond) answer.status = Status::kUnconverged;
  answer.distance = is_beyond ? answer.lower : answer.upper;
}

}  // namespace clearance
