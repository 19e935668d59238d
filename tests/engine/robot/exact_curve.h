// Bezier curves in real arithmetic, to 60 digits.
#pragma once

#include <cstddef>

#include "tests/engine/robot/exact_robot.h"

namespace clearance::test {

/// The sum of the control points times Bernstein's polynomials.
inline Real real_curve(const double* points, std::size_t count, std::size_t stride, const Real& t) {
  Real sum = 0, choose = 1;
  for (std::size_t i = 0; i < count; ++i) {
    Real term = choose * Real(points[i * stride]);
    for (std::size_t k = 0; k < i; ++k) term *= t;
    for (std::size_t k = i + 1; k < count; ++k) term *= 1 - t;
    sum += term;
    choose = choose * Real(static_cast<double>(count - 1 - i)) / Real(static_cast<double>(i + 1));
  }
  return sum;
}

}  // namespace clearance::test
