// A pose as given by users, and its rotation.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>

#include "engine/base/double_double.h"
#include "engine/base/vec.h"

namespace clearance {

/// Pose of a body in the world (X_wb) or, with a parent, in its parent (X_pb): a translation in metres and a quaternion
/// (scalar first) with a norm from 1e-6 to 1e6. Its rotation is M(q) / |q|^2. Seven float64.
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

/// Whether a pose is usable.
CLEARANCE_HD PoseQuality check(const Pose& X);

/// The rotation M(q) / |q|^2, each entry rounded once from about 100 bits: |R_ij error| <= 2^-53 |R_ij| + 2^-90.
/// The pose must not be kBad. The derivation of certify()'s constant rests on this (docs/trust/bounds.md).
CLEARANCE_HD Mat3d rotation_of(const Pose& X);

/// The same for many poses, in SIMD lanes, with the same bits.
/// \param rotations (poses.size(),) results
void rotations_of(std::span<const Pose> poses, std::span<Mat3d> rotations);

/// The same to about 100 bits.
CLEARANCE_HD Mat3<DoubleDouble> rotation_of_double_double(const Pose& X);

/// X_ac = X_ab X_bc, rounded; the quaternion is normalised. Neither may be kBad.
/// \param R_ab rotation_of(X_ab)
CLEARANCE_HD Pose compose(const Pose& X_ab, const Mat3d& R_ab, const Pose& X_bc);
CLEARANCE_HD inline Pose compose(const Pose& X_ab, const Pose& X_bc) {
  return compose(X_ab, rotation_of(X_ab), X_bc);
}
/// The same, with the rotation on request: a pose without translation needs none.
/// \param R_ab called as R_ab() for rotation_of(X_ab), at most once
template <class Rotation>
CLEARANCE_HD Pose compose_with(const Pose& X_ab, const Rotation& R_ab, const Pose& X_bc);

/// X_ba from X_ab, rounded. Must not be kBad.
CLEARANCE_HD Pose inverse(const Pose& X_ab);

namespace detail {

inline constexpr double kMinQuaternionNorm = 1e-6;   // norms from 1e-6 ...
inline constexpr double kMaxQuaternionNorm = 1e6;    // ... to 1e6 are normalised exactly
inline constexpr double kRenormalisedBeyond = 1e-3;  // a larger deviation sets the flag

CLEARANCE_HD inline double quaternion_norm(const Pose& X) {
  using std::sqrt;
  return sqrt(X.qw * X.qw + X.qx * X.qx + X.qy * X.qy + X.qz * X.qz);
}

}  // namespace detail

CLEARANCE_HD inline PoseQuality check(const Pose& X) {
  using std::abs;
  for (int k = 0; k < 3; ++k)
    if (!(abs(X.translation[k]) <= kMaxCoordinate)) return PoseQuality::kBad;
  const double n = detail::quaternion_norm(X);
  if (!(n >= detail::kMinQuaternionNorm && n <= detail::kMaxQuaternionNorm)) return PoseQuality::kBad;
  return abs(n - 1) > detail::kRenormalisedBeyond ? PoseQuality::kRenormalised : PoseQuality::kGood;
}

CLEARANCE_HD inline Mat3d rotation_of(const Pose& X) {
  const Mat3<DoubleDouble> R = rotation_of_double_double(X);
  return {{cast<double>(R.row[0]), cast<double>(R.row[1]), cast<double>(R.row[2])}};
}

CLEARANCE_HD inline Mat3<DoubleDouble> rotation_of_double_double(const Pose& X) {
  using dd::two_prod;
  const DoubleDouble ww = two_prod(X.qw, X.qw), xx = two_prod(X.qx, X.qx), yy = two_prod(X.qy, X.qy),
                     zz = two_prod(X.qz, X.qz), wx = two_prod(X.qw, X.qx), wy = two_prod(X.qw, X.qy),
                     wz = two_prod(X.qw, X.qz), xy = two_prod(X.qx, X.qy), xz = two_prod(X.qx, X.qz),
                     yz = two_prod(X.qy, X.qz);
  const DoubleDouble scale = DoubleDouble(1) / ((ww + xx) + (yy + zz));
  const auto ratio = [&](const DoubleDouble& m) { return m * scale; };
  const auto twice = [](const DoubleDouble& a) { return DoubleDouble(2 * a.hi, 2 * a.lo); };
  return {{{ratio((ww + xx) - (yy + zz)), ratio(twice(xy - wz)), ratio(twice(xz + wy))},
           {ratio(twice(xy + wz)), ratio((ww + yy) - (xx + zz)), ratio(twice(yz - wx))},
           {ratio(twice(xz - wy)), ratio(twice(yz + wx)), ratio((ww + zz) - (xx + yy))}}};
}

namespace detail {

// Whether x + 0 has the bits of x for a zero of either sign.
CLEARANCE_HD inline bool keeps_zero_added(double x) {
  return x != 0 || __builtin_copysign(1.0, x) > 0;
}

}  // namespace detail

template <class Rotation>
CLEARANCE_HD inline Pose compose_with(const Pose& a, const Rotation& R, const Pose& b) {
  const double s = 1 / (detail::quaternion_norm(a) * detail::quaternion_norm(b));
  const Vec3d& at = a.translation;
  const bool moves = !is_zero(b.translation) || !detail::keeps_zero_added(at.x) || !detail::keeps_zero_added(at.y) ||
                     !detail::keeps_zero_added(at.z);
  const Vec3d t = moves ? at + R() * b.translation : at;
  return {t, s * (a.qw * b.qw - a.qx * b.qx - a.qy * b.qy - a.qz * b.qz),
          s * (a.qw * b.qx + a.qx * b.qw + a.qy * b.qz - a.qz * b.qy),
          s * (a.qw * b.qy - a.qx * b.qz + a.qy * b.qw + a.qz * b.qx),
          s * (a.qw * b.qz + a.qx * b.qy - a.qy * b.qx + a.qz * b.qw)};
}
CLEARANCE_HD inline Pose compose(const Pose& a, const Mat3d& R, const Pose& b) {
  return compose_with(a, [&]() -> const Mat3d& { return R; }, b);
}

CLEARANCE_HD inline Pose inverse(const Pose& X) {
  const double s = 1 / detail::quaternion_norm(X);
  return {-rotation_of(X).transpose_times(X.translation), s * X.qw, -s * X.qx, -s * X.qy, -s * X.qz};
}

}  // namespace clearance
