// A piece of a body as a certificate has it: the hull of vertices, or a cylinder, cone, ellipsoid or half-space, grown
// by a radius. Of a surface, or a cloud, it is the hull around elements, which are pieces themselves.
#pragma once

#include <string_view>
#include <vector>

#include "tests/oracle/certificate/document.h"

namespace clearance::certificate_oracle {

/// A triangle between points of a list.
using Face = std::array<std::size_t, 3>;
/// Whether triangles run along each edge as often one way as the other.
bool is_closed(const std::vector<Face>& faces);

class Piece {
 public:
  explicit Piece(const Value& document);

  const Dyadic& radius() const { return radius_; }
  /// Of a surface or cloud its elements; else none.
  bool has_elements() const { return has_elements_; }
  const std::vector<Piece>& elements() const { return elements_; }
  /// Whether it is all that its triangles are around. They leave no border.
  bool is_solid() const { return is_solid_; }
  const std::vector<Face>& faces() const { return faces_; }
  /// Points of it, one at least of each part that hangs together.
  std::vector<Vector> seeds() const;

  bool is_half_space() const { return core_ == Core::kHalfSpace; }
  bool is_hull() const { return core_ == Core::kHull; }
  std::size_t count() const { return x_.size(); }
  Vector vertex(std::size_t k) const { return {x_[k], y_[k], z_[k]}; }

  /// No less than n·p of any of its points p, radius included; n need not have length 1. Throws Refusal where there is
  /// no such number: a half-space has one along its normal alone.
  Dyadic support(const Vector& n) const;
  /// No point of it is farther from the centre. Throws Refusal of a half-space.
  Dyadic reach(const Vector& centre) const;
  /// How far p is from a core that is no hull, or more; not positive in it.
  Dyadic off(const Vector& p) const;

 private:
  enum class Core { kHull, kCone, kCylinder, kEllipsoid, kHalfSpace };

  Piece() = default;
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
  std::vector<Piece> elements_;
  std::vector<Face> faces_;         // of a solid
  std::vector<std::size_t> seeds_;  // of elements: vertices
};

}  // namespace clearance::certificate_oracle
