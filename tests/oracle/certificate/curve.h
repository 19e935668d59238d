// Positions along a Bezier curve over the time from 0 to 1, exactly.
#pragma once

#include <array>
#include <vector>

#include "tests/oracle/certificate/dyadic.h"

namespace clearance::certificate_oracle {

constexpr std::size_t kMostPoints = 8;  ///< of a curve

/// Bounds on a curve in a span of time.
struct CurveExtent {
  Dyadic least, greatest;  ///< position
  Dyadic change, bend;     ///< lengths of the first and second derivative by time
};

class Curve {
 public:
  /// \param points control points, at least one
  explicit Curve(std::vector<Dyadic> points) : points_(std::move(points)) {}

  bool is_still() const;
  Dyadic at(double time) const;
  /// First derivative.
  Dyadic rate(double time) const;
  CurveExtent extent(double begin, double end) const;
  /// Control points in a span: of the curve, and of its first and second derivative.
  std::array<std::vector<Dyadic>, 3> hulls(double begin, double end) const;

 private:
  Curve derivative() const;
  // Control points of the part between two times, which contain it in their hull.
  std::vector<Dyadic> points_between(double begin, double end) const;

  std::vector<Dyadic> points_;
};

}  // namespace clearance::certificate_oracle
