#include "engine/selection/body_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/pose/sin_cos.h"

namespace clearance {

namespace {

constexpr double kUnit = 0x1p-53;
constexpr double kUp = 1 + 0x1p-40;
// Error of a rotation computed by at(), and of each coordinate of a translation: docs/trust/bounds_robots.md, "Motion".
constexpr double kTurnUnits = 128, kTimeUnits = 6;
constexpr double kHalfTurn = 0x1p-20;  // radians: distance from half a turn that counts as half a turn

double length_of(const Vec3d& v) {
  return std::hypot(v.x, v.y, v.z) * kUp;
}

}  // namespace

// Terms are split into their high and low parts by exact products and added one by one without rounding: the last
// nonzero part has the sign (Shewchuk 1997).
int sign_of_product(const Pose& q0, const Pose& q1) {
  const double a[4] = {q0.qw, q0.qx, q0.qy, q0.qz}, b[4] = {q1.qw, q1.qx, q1.qy, q1.qz};
  double parts[8];
  int count = 0;
  const auto add = [&](double x) {
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      const TwoPart<double> sum = exact_sum(x, parts[i]);
      x = sum.value;
      if (sum.rest != 0) parts[kept++] = sum.rest;
    }
    parts[kept++] = x;
    count = kept;
  };
  for (int k = 0; k < 4; ++k) {
    const TwoPart<double> product = exact_product(a[k], b[k]);
    if (product.rest != 0) add(product.rest);
    if (product.value != 0) add(product.value);
  }
  for (int i = count - 1; i >= 0; --i)
    if (parts[i] != 0) return parts[i] < 0 ? -1 : 1;
  return 0;
}

BodyMotion::BodyMotion(const Pose& start, const Pose& end) : start_(start) {
  good_ = check(start) != PoseQuality::kBad && check(end) != PoseQuality::kBad;
  const auto numbers = [](const Pose& X) {
    return std::array{X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz};
  };
  is_still_ = good_ && numbers(start) == numbers(end);
  far_ = length_of(start.translation);
  if (!good_ || is_still_) return;
  const double first = detail::quaternion_norm(start), last = detail::quaternion_norm(end);
  const int sign = sign_of_product(start, end);
  const double s = sign < 0 ? -1 : 1;
  const Quaternion<double> from{start.qw / first, -start.qx / first, -start.qy / first, -start.qz / first};
  const Quaternion<double> to{s * end.qw / last, s * end.qx / last, s * end.qy / last, s * end.qz / last};
  const Quaternion<double> between = product(from, to);
  const double cosine = sign == 0 ? 0 : std::max(between.w, 0.0);
  const double sine = std::hypot(between.x, between.y, between.z);
  double wrong = 0;  // error of half_angle_, from its own sine and cosine
  if (sine > 0) {
    axis_ = Vec3d{between.x, between.y, between.z} * (1 / sine);
    half_angle_ = std::atan2(sine, cosine);
    const SinCos<double> seen = sin_cos(half_angle_, 0.0);
    wrong = std::abs(seen.sine * cosine - seen.cosine * sine);
  }
  length_ = std::abs(first - 1) < std::abs(last - 1) ? last : first;
  along_ = end.translation - start.translation;
  shift_ = length_of(along_);
  error_turn_ = kTurnUnits * kUnit + 4 * wrong;
  turn_ = (2 * half_angle_ + error_turn_) * kUp;
  half_turn_ = 2 * half_angle_ > M_PI - kHalfTurn;
  const double from_origin = length_of(start.translation), to_origin = length_of(end.translation);
  far_ = std::max(from_origin, to_origin);
  error_shift_ = kTimeUnits * kUnit * (from_origin + to_origin) * kUp;
}

Pose BodyMotion::at(double time) const {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  if (!good_) return {{kNaN, kNaN, kNaN}, kNaN, kNaN, kNaN, kNaN};
  if (is_still_) return start_;
  const SinCos<double> half = sin_cos(time * half_angle_, 0.0);
  const double first = detail::quaternion_norm(start_), s = length_ / first;
  const Quaternion<double> from{start_.qw * s, start_.qx * s, start_.qy * s, start_.qz * s};
  const Quaternion<double> q =
      product(from, {half.cosine, half.sine * axis_.x, half.sine * axis_.y, half.sine * axis_.z});
  return {start_.translation + along_ * time, q.w, q.x, q.y, q.z};
}

}  // namespace clearance
