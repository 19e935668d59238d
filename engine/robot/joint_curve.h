// A joint's position during a motion as a Bezier curve, and bounds on it in a span of time (docs/bounds_robots.md,
// "Curves").
#pragma once

#include <cstddef>
#include <cstdint>

namespace clearance {

/// A joint in a span of time [m - h, m + h], as a motion at a constant rate and what remains. For |s| <= h, q(m + s) is
/// within `change` h of q(m), and within `bend` h^2 / 2 of q(m) + `slope` s. Bounds are rounded up.
struct JointSpan {
  double middle = 0;  ///< q(m), rounded
  double slope = 0;   ///< of the chord, per unit of time; at most `change`
  double change = 0;
  double bend = 0;
};

/// A curve over the time from 0 to 1.
class JointCurve {
 public:
  static constexpr std::uint32_t kMostPoints = 8;

  /// \param points the first control point; the others follow at intervals of `stride`
  /// \param count of control points, 2 to kMostPoints
  JointCurve(const double* points, std::uint32_t count, std::size_t stride);

  double begin() const { return points_[0]; }
  /// Position at a time, rounded.
  double at(double time) const;
  /// Bound on the error of at(), and of JointSpan::middle.
  double rounding() const { return rounding_; }
  /// Range of the control points, and so of the curve; infinite if one is NaN.
  double least() const { return least_; }
  double greatest() const { return greatest_; }
  /// Length of the control polygon, and so a bound on that of the curve. Rounded.
  double length() const;
  /// \param begin, end ascending, in [0, 1]; multiples of 2^-48
  JointSpan span(double begin, double end) const;
  /// Returns whether all positions are within limits, apart from rounding. False if subdivision does not show it.
  bool stays_within(double lower, double upper) const;

 private:
  double points_[kMostPoints];
  std::uint32_t degree_;
  double least_, greatest_, rounding_ = 0;
};

}  // namespace clearance
