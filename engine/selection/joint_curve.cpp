#include "engine/selection/joint_curve.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "engine/robot/kinematics_step.h"

namespace clearance {

namespace {

constexpr double kCurveUnit = 0x1p-53;
constexpr double kStepUnits = 6;             // error of position_between(), in roundings of the larger position
constexpr double kSpanErrors = 6;            // error of a span's control points and differences, in errors of at()
constexpr double kCurveSlack = 1 + 0x1p-30;  // covers the rounding of sums and products
constexpr int kMostHalvings = 14;            // of a curve near a limit

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

// Polar form: the value that is linear in each time, the first `ends` of which are `end`, and the others `begin`.
double polar(const double* points, std::uint32_t degree, double begin, double end, std::uint32_t ends) {
  double p[JointCurve::kMostPoints];
  std::copy_n(points, degree + 1, p);
  for (std::uint32_t level = 0; level < degree; ++level)
    for (std::uint32_t i = 0; i < degree - level; ++i)
      p[i] = position_between(p[i], p[i + 1], level < ends ? end : begin);
  return p[0];
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
  if (least_ != greatest_) rounding_ = degree_ * kStepUnits * kCurveUnit * farthest * kCurveSlack;
}

// Otherwise it must not affect the progress of others.
bool JointCurve::has_positions() const {
  return -kMaxPosition <= least_ && greatest_ <= kMaxPosition;
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

void JointCurve::part(double begin, double end, double* points, std::size_t stride) const {
  assert(0 <= begin && begin < end && end <= 1);
  double part[kMostPoints];
  std::copy_n(points_, degree_ + 1, part);
  if (begin > 0) keep_after(part, degree_, begin);
  if (end < 1) keep_before(part, degree_, (end - begin) / (1 - begin));
  for (std::uint32_t i = 0; i <= degree_; ++i) points[i * stride] = has_positions() ? part[i] : 0;
}

void JointCurve::from(double time, double end, double* points, std::size_t stride) const {
  const double first = polar(points_, degree_, time, end, 0);
  for (std::uint32_t i = 0; i <= degree_; ++i)
    points[i * stride] = has_positions() ? polar(points_, degree_, time, end, i) - first : 0;
}

bool JointCurve::stays_within(double lower, double upper) const {
  return is_curve_within(points_, degree_, lower, upper, kMostHalvings);
}

// De Casteljau's algorithm in the middle, for all curves at once. Each step rounds once.
void halve_curves(const double* points, std::uint32_t degree, std::size_t count, double* before, double* after,
                  double* scratch) {
  double *from = scratch, *to = scratch + (degree + 1) * count;
  std::copy_n(points, (degree + 1) * count, from);
  std::copy_n(from, count, before);
  std::copy_n(from + degree * count, count, after + degree * count);
  for (std::uint32_t level = 1; level <= degree; ++level) {
    const std::size_t rest = (degree + 1 - level) * count;
    const double* __restrict const p = from;
    double* __restrict const q = to;
    for (std::size_t i = 0; i < rest; ++i) q[i] = 0.5 * p[i] + 0.5 * p[i + count];
    std::copy_n(q, count, before + level * count);
    std::copy_n(q + rest - count, count, after + (degree - level) * count);
    std::swap(from, to);
  }
}

// Projects the control points on the chord. Progress is 0 in the middle, and has the sign of the time.
void CurveSpan::take_progress(std::uint32_t degree) {
  const std::size_t count = joints_.size();
  progress_.assign(points_, 0);
  double squared = 0;
  for (std::size_t j = 0; j < count; ++j) {
    const double chord = joints_[j].slope = points_of_[(points_ - 1) * count + j] - points_of_[j];
    squared += chord * chord;
    for (std::uint32_t i = 0; i < points_; ++i) progress_[i] += chord * points_of_[i * count + j];
  }
  farthest_ = 0;
  for (std::uint32_t i = 0; i < points_; ++i) {
    double& r = progress_[i];
    const bool is_middle = i == degree || i == degree + 1;
    r = squared > 0 && !is_middle ? r / squared : 0;
    r = i <= degree ? std::min(r, 0.0) : std::max(r, 0.0);
    farthest_ = std::max(farthest_, std::abs(r));
  }
}

void CurveSpan::take(std::span<const JointCurve> curves, const double* points, double half) {
  const std::uint32_t degree = curves.empty() ? 1 : curves[0].degree();
  const std::size_t count = curves.size(), each = (degree + 1) * count;
  points_ = 2 * (degree + 1);
  halves_.resize(2 * each);
  scratch_.resize(2 * each);
  points_of_.resize(2 * each);
  joints_.assign(count, {});
  halve_curves(points, degree, count, halves_.data(), halves_.data() + each, scratch_.data());
  const double* const middle = halves_.data() + each;
  for (std::uint32_t i = 0; i < points_; ++i)
    for (std::size_t j = 0; j < count; ++j) points_of_[i * count + j] = halves_[i * count + j] - middle[j];
  take_progress(degree);
  for (std::size_t j = 0; j < count; ++j) {
    JointSpan& joint = joints_[j];
    double way = 0, rest = 0;
    for (std::uint32_t i = 0; i < points_; ++i) {
      const double p = points_of_[i * count + j];
      way = std::max(way, std::abs(p));
      rest = std::max(rest, std::abs(p - joint.slope * progress_[i]));
    }
    const double error = kSpanErrors * curves[j].rounding();
    joint.slope *= farthest_ / half;
    joint.change = std::max((way + error) / half * kCurveSlack, std::abs(joint.slope));
    joint.bend = 2 * (rest + error) / (half * half) * kCurveSlack;
  }
}

}  // namespace clearance
