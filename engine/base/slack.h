// What is not known of bodies, as lengths that bounds are widened by (docs/bounds.md, "Slack"). For host and device.
#pragma once

#include "engine/base/vec.h"

namespace clearance {

/// x + y, y >= 0, rounded up; x itself where y is 0.
CLEARANCE_HD inline double sum_above(double x, double y) {
  if (y == 0) return x;
  const double sum = x + y;
  return sum + (sum < 0 ? -sum : sum) * 0x1p-52;
}
/// x - y, y >= 0, rounded down; x itself where y is 0.
CLEARANCE_HD inline double difference_below(double x, double y) {
  if (y == 0) return x;
  const double difference = x - y;
  return difference - (difference < 0 ? -difference : difference) * 0x1p-52;
}

/// How a body's pieces, placed as they are, may miss the true body; or two bodies' together. Metres, rounded up.
struct Slack {
  double inner = 0;  ///< no point of the true body is farther from the pieces
  double outer = 0;  ///< no point of the pieces is farther from the true body

  CLEARANCE_HD bool any() const { return inner > 0 || outer > 0; }
  /// Bounds on the distance of the pieces become bounds on that of the true bodies: here, and nowhere else.
  CLEARANCE_HD double true_lower(double lower) const { return difference_below(lower, inner); }
  CLEARANCE_HD double true_upper(double upper) const { return sum_above(upper, outer); }
  /// Pieces farther apart than this prove that the true bodies are farther apart than max_distance: more than
  /// rounding takes from true_lower().
  CLEARANCE_HD double cut_off(double max_distance) const {
    return inner == 0 ? max_distance : (max_distance + inner) * (1 + 0x1p-50);
  }
  /// Pieces that are no farther apart than this prove that the true bodies are within a margin: less by more than
  /// rounding adds in true_upper().
  CLEARANCE_HD double near_enough(double margin) const {
    return outer == 0 ? margin : (margin - outer) - (margin + outer) * 0x1p-50;
  }
};
/// Of two bodies whose doubts have nothing to do with each other.
CLEARANCE_HD inline Slack operator+(const Slack& a, const Slack& b) {
  return {sum_above(a.inner, b.inner), sum_above(a.outer, b.outer)};
}

}  // namespace clearance
