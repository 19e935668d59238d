// A convex part of a body in a certificate: the hull of vertices, or a cylinder, cone, ellipsoid or half-space, grown
// by a radius. For a surface or a cloud it is the hull around elements, which are parts themselves.
#pragma once

#include <string_view>
#include <vector>

#include "tests/oracle/certificate/document.h"

namespace clearance::certificate_oracle {

/// A triangle between points of a list.
using Face = std::array<std::size_t, 3>;
/// Whether triangles use each edge equally often both ways.
bool is_closed(const std::vector<Face>& faces);

class ConvexPart {
 public:
  explicit ConvexPart(const Value& document);

  const Dyadic& radius() const { return radius_; }
  /// Elements of a surface or cloud; empty for others.
  bool has_elements() const { return has_elements_; }
  const std::vector<ConvexPart>& elements() const { return elements_; }
  /// Whether it is the volume enclosed by its triangles, which have no border.
  bool is_solid() const { return is_solid_; }
  const std::vector<Face>& faces() const { return faces_; }
  /// Points of it, at least one for each connected component.
  std::vector<Vector> seeds() const;

  bool is_half_space() const { return core_ == Core::kHalfSpace; }
  bool is_hull() const { return core_ == Core::kHull; }
  std::size_t count() const { return x_.size(); }
  Vector vertex(std::size_t k) const { return {x_[k], y_[k], z_[k]}; }

  /// Upper bound on n·p over its points p, radius included; n need not have length 1. Throws `Rejection` if there is no
  /// such number: a half-space has one along its normal only.
  Dyadic support(const Vector& n) const;
  /// Bound on the distance of its points from the centre. Throws `Rejection` for a half-space.
  Dyadic reach(const Vector& centre) const;
  /// Upper bound on the distance of p from a core that is no hull; not positive in it.
  Dyadic off(const Vector& p) const;

 private:
  enum class Core { kHull, kCone, kCylinder, kEllipsoid, kHalfSpace };

  ConvexPart() = default;
  static Core core_named(std::string_view kind);
  void read_elements(const Value& document);
  void add_vertex(double x, double y, double z);
  Dyadic farthest_along(const Vector& n) const;
  Dyadic farthest_squared(const Vector& centre) const;

  Core core_ = Core::kHull;
  Dyadic radius_;
  Vector size_;                    // of a round core
  std::vector<double> x_, y_, z_;  // of the vertices
  double largest_ = 0;             // of all coordinates
  mutable std::vector<double> scratch_;
  bool has_elements_ = false, is_solid_ = false;
  std::vector<ConvexPart> elements_;
  std::vector<Face> faces_;         // of a solid
  std::vector<std::size_t> seeds_;  // of elements: vertices
};

}  // namespace clearance::certificate_oracle
