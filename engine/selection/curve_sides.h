// Curves on both sides of a time (docs/trust/bounds_robots.md, "Sides of a time").
#pragma once

#include <span>
#include <vector>

#include "engine/selection/joint_curve.h"

namespace clearance {

/// Some curves q from a time m until either end of a span: side 0 until its begin, side 1 until its end. On a side, q is
/// within `rest` of q(m) + r `chord`, where r is the same for all curves and has control points from 0 to 1.
class CurveSides {
 public:
  /// Of one curve. Bounds are rounded up, and those without a side hold on both.
  struct Curve {
    double chord[2] = {0, 0};  ///< from q(m) to the end of a side, rounded
    double way = 0;            ///< bound on |q - q(m)|
    double rest = 0;           ///< includes the error of `chord`
    double change = 0;         ///< bound on |chord| + rest
  };

  /// \param curves of one degree
  /// \param begin, time, end ascending, in [0, 1]
  void take(std::span<const JointCurve> curves, double begin, double time, double end);

  std::span<const Curve> curves() const { return curves_; }
  /// Control points of r, degree + 1 of them; decimals of six places.
  std::span<const double> progress(int side) const { return progress_[side]; }
  /// r is at most x for a share of pace(side) x of the side's time. At most 1; rounded down.
  double pace(int side) const;

 private:
  void take_side(std::span<const JointCurve> curves, double time, double end, int side);

  std::vector<Curve> curves_;
  std::vector<double> progress_[2];
  std::vector<double> points_;  // (degree + 1, curves) of one side, relative to q(m)
};

/// Returns the time in a span that divides the curves' common length, or nearly so: a multiple of a power of two.
/// \param begin, end ascending, in [0, 1]
double middle_of_length(std::span<const JointCurve> curves, double begin, double end);

}  // namespace clearance
