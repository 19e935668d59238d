// Poses and rotations in numbers with 320 bits after the point.
#pragma once

#include "tests/oracle/certificate/dyadic.h"

namespace clearance::certificate_oracle {

/// Computed poses are multiples of 2^-kBits, rounded down; the resulting motion of a point is below blur().
constexpr long kBits = 320;
const Dyadic& blur();

/// Pose of a frame: a point p of it is at origin + rows p / divisor.
struct Pose {
  Vector origin;
  Rows rows{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
  Dyadic divisor = 1.0;  ///< > 0
  bool is_rounded = false;
};

/// Multiples of 2^-kBits.
Vector rounded(const Vector& v, const Dyadic& divisor = 1.0);
/// The direction v, normalised. v is not zero.
Vector unit(const Vector& v);

struct Quaternion {
  Dyadic w;
  Vector v;
};

/// From a quaternion of any length but 0, exactly. Throws `Rejection`.
Pose pose_of(const Vector& origin, const Quaternion& q);
/// The rotation about an axis of length 1. Throws `Rejection` for an angle of 2^21 or more.
Pose turn_about(const Vector& axis, const Dyadic& angle);

/// The shorter rotation from one quaternion to another, in the frame of the first.
struct Turn {
  Vector axis;
  Dyadic angle;  ///< 0 for none
};
Turn turn_between(const Quaternion& from, const Quaternion& to);

/// A pose in the frame of another.
Pose composed(const Pose& outer, const Pose& inner);

/// Upper bound on 2 sin(angle / 2), the motion of a point 1 m from the axis; 2 from half a turn on.
Dyadic chord_above(const Dyadic& angle);

}  // namespace clearance::certificate_oracle
