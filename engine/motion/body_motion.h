// How a body whose poses a query gives gets from one to the other: docs/bounds.md, "Motion".
#pragma once

#include "engine/pose/pose.h"
#include "engine/pose/quaternion.h"

namespace clearance {

/// A straight line, and a turn of constant angular velocity by no more than half a turn: of q1 and -q1, which stand for
/// the same pose, the one that is nearer to q0 counts; where both are equally near (the sign of q0 . q1 is exact), q1.
class BodyMotion {
 public:
  BodyMotion(const Pose& start, const Pose& end);

  /// Whether both poses can be used.
  bool is_good() const { return good_; }
  /// Whether it turns so nearly by half a turn that a little less or more would turn it the other way.
  bool is_half_turn() const { return half_turn_; }
  /// The pose at a time from 0 to 1, rounded; NaN if one of the poses cannot be used. Its quaternion is as long as that
  /// of the two that is farther from length 1.
  Pose at(double time) const;

  Vec3d along() const { return along_; }  ///< from one pose's origin to the other's, in the frame that they are in
  double angle() const { return 2 * half_angle_; }  ///< of the turn, rounded
  double shift() const { return shift_; }           ///< metres from one pose to the other, rounded up
  double turn() const { return turn_; }             ///< radians likewise
  Vec3d axis() const { return axis_; }      ///< of that turn, of length 1, in the body's axes and in those at its start
  double farthest() const { return far_; }  ///< metres: the origin is never farther from its frame's, rounded up
  double turn_error() const { return error_turn_; }  ///< radians that at() may turn it too far, at most
  /// Metres: how far at() may put a point that is up to `radius` metres from the body's origin from its place.
  double error(double radius) const { return error_shift_ + error_turn_ * radius; }

 private:
  Pose start_;
  Vec3d along_{0, 0, 0}, axis_{0, 0, 0};
  double half_angle_ = 0, length_ = 1;  // of the turn; of what at() makes
  double shift_ = 0, turn_ = 0, far_ = 0, error_shift_ = 0, error_turn_ = 0;
  bool good_ = false, is_still_ = false, half_turn_ = false;
};

/// The sign of q0 . q1, exactly: -1, 0 or 1.
int sign_of_product(const Pose& q0, const Pose& q1);

}  // namespace clearance
