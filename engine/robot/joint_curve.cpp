#include "engine/robot/joint_curve.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/robot/motion_path_step.h"

namespace clearance {

namespace {

constexpr double kCurveUnit = 0x1p-53;
constexpr double kStepUnits = 6;   // error of position_between(), in roundings of the larger position
constexpr double kSpanErrors = 6;  // error of a span's control points and differences, in errors of at()
constexpr int kMostHalvings = 14;  // of a curve near a limit

double position_between(double a, double b, double t) {
  return a + t * (b - a);
}

// De Casteljau's algorithm, in place: the control points of the curve from a time on.
void keep_after(double* points, std::uint32_t degree, double time) {
  for (std::uint32_t left = degree; left > 0; --left)
    for (std::uint32_t i = 0; i < left; ++i) points[i] = position_between(points[i], points[i + 1], time);
}
// Likewise, until that time.
void keep_before(double* points, std::uint32_t degree, double time) {
  for (std::uint32_t first = 1; first <= degree; ++first)
    for (std::uint32_t i = degree; i >= first; --i) points[i] = position_between(points[i - 1], points[i], time);
}

bool is_curve_within(const double* points, std::uint32_t degree, double lower, double upper, int halvings) {
  const auto is_inside = [=](double p) { return lower <= p && p <= upper; };
  if (std::all_of(points, points + degree + 1, is_inside)) return true;
  if (!is_inside(points[0]) || !is_inside(points[degree]) || halvings == 0) return false;
  double half[JointCurve::kMostPoints];
  std::copy_n(points, degree + 1, half);
  keep_before(half, degree, 0.5);
  if (!is_curve_within(half, degree, lower, upper, halvings - 1)) return false;
  std::copy_n(points, degree + 1, half);
  keep_after(half, degree, 0.5);
  return is_curve_within(half, degree, lower, upper, halvings - 1);
}

}  // namespace

JointCurve::JointCurve(const double* points, std::uint32_t count, std::size_t stride)
    : degree_(count - 1), least_(points[0]), greatest_(points[0]) {
  assert(count >= 2 && count <= kMostPoints);
  for (std::uint32_t i = 0; i < count; ++i) {
    points_[i] = points[i * stride];
    if (!(least_ <= points_[i])) least_ = std::isnan(points_[i]) ? -HUGE_VAL : points_[i];
    if (!(greatest_ >= points_[i])) greatest_ = std::isnan(points_[i]) ? HUGE_VAL : points_[i];
  }
  const double farthest = std::max(-least_, greatest_);
  if (least_ != greatest_) rounding_ = degree_ * kStepUnits * kCurveUnit * farthest * kMotionSlack;
}

double JointCurve::at(double time) const {
  double points[kMostPoints];
  std::copy_n(points_, degree_ + 1, points);
  keep_after(points, degree_, time);
  return points[0];
}

double JointCurve::length() const {
  double sum = 0;
  for (std::uint32_t i = 0; i < degree_; ++i) sum += std::abs(points_[i + 1] - points_[i]);
  return sum;
}

JointSpan JointCurve::span(double begin, double end) const {
  assert(0 <= begin && begin < end && end <= 1);
  double before[kMostPoints], after[kMostPoints];
  std::copy_n(points_, degree_ + 1, before);
  if (begin > 0) keep_after(before, degree_, begin);
  if (end < 1) keep_before(before, degree_, (end - begin) / (1 - begin));
  std::copy_n(before, degree_ + 1, after);
  const double half = 0.5 * (end - begin);
  JointSpan span;
  span.middle = at(0.5 * begin + 0.5 * end);
  span.slope = (before[degree_] - before[0]) / (end - begin);
  keep_before(before, degree_, 0.5);
  keep_after(after, degree_, 0.5);
  double way = 0, rest = 0;
  for (std::uint32_t i = 0; i <= degree_; ++i) {
    const double along = half * i / degree_, p = before[i] - span.middle, q = after[i] - span.middle;
    way = std::max({way, std::abs(p), std::abs(q)});
    rest = std::max({rest, std::abs(p - span.slope * (along - half)), std::abs(q - span.slope * along)});
  }
  const double error = kSpanErrors * rounding_;
  span.change = (way + error) / half * kMotionSlack;
  span.bend = 2 * (rest + error) / (half * half) * kMotionSlack;
  return span;
}

bool JointCurve::stays_within(double lower, double upper) const {
  return is_curve_within(points_, degree_, lower, upper, kMostHalvings);
}

}  // namespace clearance
