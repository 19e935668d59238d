// Motion of a body between two poses that a query gives: docs/trust/bounds_robots.md, "Motion".
#pragma once

#include "engine/pose/pose.h"
#include "engine/pose/quaternion.h"

namespace clearance {

/// A straight line, and a rotation of constant angular velocity by at most half a turn. q1 and -q1 are the same pose:
/// the one nearer to q0 is used or, if both are equally near (the sign of q0 . q1 is exact), q1.
class BodyMotion {
 public:
  BodyMotion(const Pose& start, const Pose& end);

  /// Returns whether both poses are usable.
  bool is_good() const { return good_; }
  /// Returns whether the angle is so close to half a turn that rounding could reverse the direction.
  bool is_half_turn() const { return half_turn_; }
  /// The pose at a time in [0, 1], rounded; NaN if one of the poses is unusable. Its quaternion has the length of the
  /// given one that is farther from length 1.
  Pose at(double time) const;

  Vec3d along() const { return along_; }            ///< from one pose's origin to the other's, in their common frame
  double angle() const { return 2 * half_angle_; }  ///< of the rotation, rounded
  double shift() const { return shift_; }           ///< metres from one pose to the other, rounded up
  double turn() const { return turn_; }             ///< radians from one pose to the other, rounded up
  Vec3d axis() const { return axis_; }      ///< unit axis of the rotation, in the body's axes and in those at its start
  double farthest() const { return far_; }  ///< upper bound on the origin's distance from its frame's origin, in metres
  double turn_error() const { return error_turn_; }  ///< upper bound on the rotation error of at(), in radians
  /// Upper bound on the error of at(), in metres, for points up to `radius` metres from the body's origin.
  double error(double radius) const { return error_shift_ + error_turn_ * radius; }

 private:
  Pose start_;
  Vec3d along_{0, 0, 0}, axis_{0, 0, 0};
  double half_angle_ = 0, length_ = 1;  // of the rotation; of the quaternion that at() returns
  double shift_ = 0, turn_ = 0, far_ = 0, error_shift_ = 0, error_turn_ = 0;
  bool good_ = false, is_still_ = false, half_turn_ = false;
};

/// The sign of q0 . q1, exactly: -1, 0 or 1.
int sign_of_product(const Pose& q0, const Pose& q1);

}  // namespace clearance
