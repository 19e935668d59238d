// Uncertainty of bodies as lengths that widen bounds (docs/trust/bounds_bodies.md, "Slack"). For host and device.
#pragma once

#include "engine/base/vec.h"

namespace clearance {

/// x + y for y >= 0, rounded up; exactly x if y is 0.
CLEARANCE_HD inline double sum_above(double x, double y) {
  if (y == 0) return x;
  const double sum = x + y;
  return sum + (sum < 0 ? -sum : sum) * 0x1p-52;
}
/// x - y for y >= 0, rounded down; exactly x if y is 0.
CLEARANCE_HD inline double difference_below(double x, double y) {
  if (y == 0) return x;
  const double difference = x - y;
  return difference - (difference < 0 ? -difference : difference) * 0x1p-52;
}

/// Deviation of the placed convex parts from the true body, or the sum for two bodies. Metres, rounded up.
struct Slack {
  double inner = 0;  ///< bound on the distance of the true body's points from the convex parts
  double outer = 0;  ///< bound on the distance of the parts' points from the true body

  CLEARANCE_HD bool any() const { return inner > 0 || outer > 0; }
  /// Converts a bound on the distance of the parts to a bound on that of the true bodies. The only place that does so.
  CLEARANCE_HD double true_lower(double lower) const { return difference_below(lower, inner); }
  CLEARANCE_HD double true_upper(double upper) const { return sum_above(upper, outer); }
  /// Distance of the parts beyond which the true bodies are proved farther apart than max_distance. Exceeds the exact
  /// value by more than the rounding of true_lower().
  CLEARANCE_HD double cut_off(double max_distance) const {
    return inner == 0 ? max_distance : (max_distance + inner) * (1 + 0x1p-50);
  }
  /// Distance of the parts up to which the true bodies are proved within a margin. Less than the exact value by more
  /// than the rounding of true_upper().
  CLEARANCE_HD double near_enough(double margin) const {
    return outer == 0 ? margin : (margin - outer) - (margin + outer) * 0x1p-50;
  }
};
/// Sum for two bodies with independent uncertainties.
CLEARANCE_HD inline Slack operator+(const Slack& a, const Slack& b) {
  return {sum_above(a.inner, b.inner), sum_above(a.outer, b.outer)};
}

}  // namespace clearance
