// A pose as the contract states it, and the rotation that it stands for.
#pragma once

#include <cstdint>
#include <span>

#include "double_double.h"
#include "math.h"

namespace clearance {

/// Pose of a body in the world (X_wb) or, of a body with a parent, in its parent (X_pb): a translation in metres and a
/// quaternion (scalar first) of any norm from 1e-6 to 1e6, which stands for the rotation M(q) / |q|^2. Seven float64.
struct Pose {
  Vec3d translation{0, 0, 0};
  double qw = 1, qx = 0, qy = 0, qz = 0;
};
static_assert(sizeof(Pose) == 7 * sizeof(double));

enum class PoseQuality : std::uint8_t {
  kGood,
  kRenormalised,  ///< usable; |q| is off by more than 1e-3
  kBad,           ///< NaN, Inf, a norm outside [1e-6, 1e6], or a translation beyond kMaxCoordinate
};

/// Largest coordinate, in metres, of a vertex or a translation. Beyond it products of coordinates could overflow.
inline constexpr double kMaxCoordinate = 1e60;

/// Whether a pose may be used.
PoseQuality check(const Pose& X);

/// The rotation M(q) / |q|^2, each entry rounded once from about 100 bits: |R_ij error| <= 2^-53 |R_ij| + 2^-90.
/// The pose must not be kBad. The derivation of certify()'s constant rests on this (docs/bounds.md).
Mat3d rotation_of(const Pose& X);

/// The same to about 100 bits.
Mat3<DoubleDouble> rotation_of_double_double(const Pose& X);

/// X_ac = X_ab X_bc, rounded; the quaternion is normalised. Neither may be kBad.
Pose compose(const Pose& X_ab, const Pose& X_bc);

/// X_ba from X_ab, rounded. Must not be kBad.
Pose inverse(const Pose& X_ab);

}  // namespace clearance
