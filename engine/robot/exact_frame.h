// Frames of a URDF to about 95 bits, from which constants are rounded only once.
#pragma once

#include "engine/base/double_double.h"
#include "engine/pose/quaternion.h"
#include "engine/robot/robot.h"

namespace clearance {

/// Pose of a frame in another, to about 95 bits.
struct ExactFrame {
  Quaternion<DoubleDouble> q{1, 0, 0, 0};
  Vec3<DoubleDouble> t{0, 0, 0};
};

inline ExactFrame operator*(const ExactFrame& a, const ExactFrame& b) {
  return {product(a.q, b.q), a.t + turned(a.q, b.t)};
}

/// Rz(yaw) Ry(pitch) Rx(roll), then xyz.
ExactFrame exact_frame(const Origin& origin);

/// Returns the float64 vector nearest to v.
/// \param off set to the length of the rounding error
Vec3d rounded(const Vec3<DoubleDouble>& v, double* off);
Quaternion<double> rounded(const Quaternion<DoubleDouble>& q, double* off);

}  // namespace clearance
