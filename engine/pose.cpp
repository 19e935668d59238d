#include "pose.h"

#include <algorithm>
#include <cmath>

#include "double_double.h"

namespace clearance {

namespace {

constexpr double kMinQuaternionNorm = 1e-6;   // design contract: from 1e-6 ...
constexpr double kMaxQuaternionNorm = 1e6;    // ... to 1e6 is normalised exactly
constexpr double kRenormalisedBeyond = 1e-3;  // off by more than this sets the flag

double quaternion_norm(const Pose& X) {
  return std::sqrt(X.qw * X.qw + X.qx * X.qx + X.qy * X.qy + X.qz * X.qz);
}

}  // namespace

PoseQuality check(const Pose& X) {
  for (const double t : {X.translation.x, X.translation.y, X.translation.z})
    if (!(std::abs(t) <= kMaxCoordinate)) return PoseQuality::kBad;
  const double n = quaternion_norm(X);
  if (!(n >= kMinQuaternionNorm && n <= kMaxQuaternionNorm)) return PoseQuality::kBad;
  return std::abs(n - 1) > kRenormalisedBeyond ? PoseQuality::kRenormalised : PoseQuality::kGood;
}

Mat3d rotation_of(const Pose& X) {
  const Mat3<DoubleDouble> R = rotation_of_double_double(X);
  return {{cast<double>(R.row[0]), cast<double>(R.row[1]), cast<double>(R.row[2])}};
}

Mat3<DoubleDouble> rotation_of_double_double(const Pose& X) {
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

Pose compose(const Pose& a, const Pose& b) {
  const double s = 1 / (quaternion_norm(a) * quaternion_norm(b));
  const Vec3d t = a.translation + rotation_of(a) * b.translation;
  return {t,
          s * (a.qw * b.qw - a.qx * b.qx - a.qy * b.qy - a.qz * b.qz),
          s * (a.qw * b.qx + a.qx * b.qw + a.qy * b.qz - a.qz * b.qy),
          s * (a.qw * b.qy - a.qx * b.qz + a.qy * b.qw + a.qz * b.qx),
          s * (a.qw * b.qz + a.qx * b.qy - a.qy * b.qx + a.qz * b.qw)};
}

Pose inverse(const Pose& X) {
  const double s = 1 / quaternion_norm(X);
  return {-rotation_of(X).transpose_times(X.translation), s * X.qw, -s * X.qx, -s * X.qy, -s * X.qz};
}

}  // namespace clearance
