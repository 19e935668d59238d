// A piece of a body as a certificate has it: the hull of vertices, or a cylinder, cone or ellipsoid, grown by a radius.
#pragma once

#include <vector>

#include "document.h"

namespace clearance::judge {

class Piece {
 public:
  explicit Piece(const Value& document);

  const Dyadic& radius() const { return radius_; }
  bool is_round() const { return core_ != Core::kHull; }
  std::size_t count() const { return x_.size(); }
  Vector vertex(std::size_t k) const { return {x_[k], y_[k], z_[k]}; }

  /// No less than n·p of any of its points p, radius included; n need not have length 1.
  Dyadic support(const Vector& n) const;
  /// No point of it is farther from the centre.
  Dyadic reach(const Vector& centre) const;
  /// How far p is from a round core, or more; not positive in it.
  Dyadic off(const Vector& p) const;

 private:
  enum class Core { kHull, kCone, kCylinder, kEllipsoid };

  Dyadic farthest_along(const Vector& n) const;
  Dyadic farthest_squared(const Vector& centre) const;

  Core core_ = Core::kHull;
  Dyadic radius_;
  Vector size_;                    // of a round core
  std::vector<double> x_, y_, z_;  // of the vertices
  double largest_ = 0;             // of all coordinates
  mutable std::vector<double> scratch_;
};

}  // namespace clearance::judge
