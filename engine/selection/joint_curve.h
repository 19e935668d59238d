// A joint's position during a motion as a Bezier curve, and bounds on it in a span of time
// (docs/trust/bounds_robots.md, "Curves").
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace clearance {

/// A joint in a span of time [m - h, m + h], as a part of a straight motion and a remainder. For |s| <= h, q(m + s) is
/// within `change` h of q(m), and within `bend` h^2 / 2 of q(m) + `slope` r, where r in [-h, h] is the same for all
/// joints and has the sign of s. Bounds are rounded up.
struct JointSpan {
  double slope = 0;  ///< per unit of time; at most `change`
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
  /// Bound on the error of at().
  double rounding() const { return rounding_; }
  /// Range of the control points, and so of the curve; infinite if one is NaN.
  double least() const { return least_; }
  double greatest() const { return greatest_; }
  double farthest() const { return least_ < -greatest_ ? -least_ : greatest_; }  ///< bound on its distance from 0
  /// Length of the control polygon, and so a bound on that of the curve. Rounded.
  double length() const;
  /// Control points of a span; 0 for a curve without positions.
  /// \param begin, end ascending, in [0, 1]; multiples of 2^-48
  /// \param points receives degree() + 1 numbers at intervals of `stride`
  void part(double begin, double end, double* points, std::size_t stride) const;
  std::uint32_t degree() const { return degree_; }
  /// Control points from a time until another one, earlier or later, relative to the position at the former, each within
  /// 3 rounding(); 0 for a curve without positions.
  /// \param time, end in [0, 1]
  /// \param points receives degree() + 1 numbers at intervals of `stride`
  void from(double time, double end, double* points, std::size_t stride) const;
  /// Returns whether all positions are within limits, apart from rounding. False if subdivision does not show it.
  bool stays_within(double lower, double upper) const;

 private:
  bool has_positions() const;

  double points_[kMostPoints];
  std::uint32_t degree_;
  double least_, greatest_, rounding_ = 0;
};

/// Control points of both halves of some curves, from those of the whole: (degree + 1, count) each.
/// \param scratch 2 (degree + 1) count numbers
void halve_curves(const double* points, std::uint32_t degree, std::size_t count, double* before, double* after,
                  double* scratch);

/// All joints of a motion in a span of time. Reusable memory.
class CurveSpan {
 public:
  /// For a span that at most kMostHalvings halvings have cut out, or JointCurve::part().
  /// \param curves of the joints, of one degree
  /// \param points (degree + 1, curves.size()) control points of the span
  /// \param half of its length
  void take(std::span<const JointCurve> curves, const double* points, double half);
  static constexpr int kMostHalvings = 11;

  /// Control points of the parts before and after the middle, one after the other: (2, degree + 1, curves).
  std::span<const double> halves() const { return halves_; }
  std::span<const JointSpan> joints() const { return joints_; }

 private:
  void take_progress(std::uint32_t degree);

  std::uint32_t points_ = 0;  // of a joint, in both parts
  std::vector<double> halves_;
  std::vector<double> points_of_;  // (points_, joints), relative to the middle
  std::vector<double> scratch_;
  std::vector<double> progress_;  // (points_,) of r: control points for a chord of 1
  std::vector<JointSpan> joints_;
  double farthest_ = 0;  // greatest |progress_|
};

}  // namespace clearance
