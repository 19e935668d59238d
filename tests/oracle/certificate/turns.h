// Poses and turns in numbers of 320 bits behind the point.
#pragma once

#include "tests/oracle/certificate/dyadic.h"

namespace clearance::certificate_oracle {

/// Poses that are computed are multiples of 2^-kBits, rounded down; what that moves a point by is below blur().
constexpr long kBits = 320;
const Dyadic& blur();

/// Where a frame stands: a point p of it is at origin + rows p / divisor.
struct Pose {
  Vector origin;
  Rows rows{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
  Dyadic divisor = 1.0;  ///< > 0
  bool is_rounded = false;
};

/// Multiples of 2^-kBits.
Vector rounded(const Vector& v, const Dyadic& divisor = 1.0);
/// The direction v made as long as 1. v is not zero.
Vector unit(const Vector& v);

struct Quaternion {
  Dyadic w;
  Vector v;
};

/// Of a quaternion of any length but 0, exactly. Throws Refusal.
Pose pose_of(const Vector& origin, const Quaternion& q);
/// The turn about an axis of length 1. Throws Refusal of an angle of 2^21 or more.
Pose turn_about(const Vector& axis, const Dyadic& angle);

/// The turn from one quaternion to another, the shorter way, in the frame that the first one makes.
struct Turn {
  Vector axis;
  Dyadic angle;  ///< 0: none
};
Turn turn_between(const Quaternion& from, const Quaternion& to);

/// A pose in the frame of another.
Pose composed(const Pose& outer, const Pose& inner);

/// No less than 2 sin(angle / 2), how far a point moves that is 1 m from the axis; 2 from half a turn on.
Dyadic chord_above(const Dyadic& angle);

}  // namespace clearance::certificate_oracle
