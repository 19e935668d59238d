// Positions along a Bezier curve over the time from 0 to 1, exactly.
#pragma once

#include <vector>

#include "tests/oracle/certificate/dyadic.h"

namespace clearance::certificate_oracle {

constexpr std::size_t kMostPoints = 8;  ///< of a curve

class Curve {
 public:
  /// \param points control points, at least one
  explicit Curve(std::vector<Dyadic> points) : points_(std::move(points)) {}

  bool is_still() const;
  Dyadic at(double time) const;
  /// Control points from a time until another one, earlier or later, less the position at the former.
  std::vector<Dyadic> way(double time, double end) const;

 private:
  std::vector<Dyadic> points_;
};

}  // namespace clearance::certificate_oracle
