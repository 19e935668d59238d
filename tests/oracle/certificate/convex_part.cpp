#include "tests/oracle/certificate/convex_part.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

namespace clearance::certificate_oracle {
namespace {

// No product of such coordinates overflows; larger ones are always computed exactly.
constexpr double kLargest = 0x1p400;

// The largest of exact(k), whose rough values have an error of at most `wrong`. Only candidates for it are computed.
template <class Exact>
Dyadic largest_of(const std::vector<double>& rough, double wrong, Exact&& exact) {
  const double best = *std::max_element(rough.begin(), rough.end());
  std::optional<Dyadic> largest;
  for (std::size_t k = 0; k < rough.size(); ++k) {
    if (rough[k] < best - 2 * wrong) continue;
    Dyadic found = exact(k);
    if (!largest || found > *largest) largest = std::move(found);
  }
  return *largest;
}

// n times a power of two, as float64 in [-1, 1], each with an error below 2^-51.
std::array<double, 3> rough_direction(const Vector& n) {
  std::array<double, 3> d;
  std::array<long, 3> power;
  long most = std::numeric_limits<long>::min();
  for (std::size_t k = 0; k < 3; ++k) {
    d[k] = n[k].rough(power[k]);
    if (d[k] != 0) most = std::max(most, power[k]);
  }
  for (std::size_t k = 0; k < 3; ++k)
    if (d[k] != 0) d[k] = std::ldexp(d[k], static_cast<int>(std::max(power[k] - most, -2000L)));
  return d;
}

}  // namespace

ConvexPart::Core ConvexPart::core_named(std::string_view kind) {
  if (kind == "cone") return Core::kCone;
  if (kind == "cylinder") return Core::kCylinder;
  if (kind == "ellipsoid") return Core::kEllipsoid;
  require(kind == "half_space", "a core is of no known kind");
  return Core::kHalfSpace;
}

ConvexPart::ConvexPart(const Value& document) : radius_(document["radius"].length()) {
  if (const Value* core = document.find("core")) {
    core_ = core_named((*core)["kind"].text());
    size_ = (*core)["size"].vector();
    require(std::min({size_[0], size_[1], size_[2]}).sign() >= (is_half_space() ? 0 : 1), "a core has no size");
  }
  for (const Value& vertex : document["vertices"].list()) {
    const auto [x, y, z] = vertex.three();
    add_vertex(x, y, z);
  }
  require(!x_.empty() && document["count"].integer() == static_cast<std::int64_t>(x_.size()),
          "a piece has another number of vertices than it states");
  read_elements(document);
}

void ConvexPart::add_vertex(double x, double y, double z) {
  x_.push_back(x);
  y_.push_back(y);
  z_.push_back(z);
  largest_ = std::max({largest_, std::abs(x), std::abs(y), std::abs(z)});
}

void ConvexPart::read_elements(const Value& document) {
  const Value *const elements = document.find("elements"), *const solid = document.find("solid");
  is_solid_ = solid && solid->boolean();
  has_elements_ = elements != nullptr;
  require(has_elements_ || !is_solid_, "a solid has no triangles");
  if (!has_elements_) return;
  require(is_hull() && !elements->list().empty(), "a surface has no elements");
  std::vector<std::size_t> part(count());  // a forest: a connected component has one root
  std::iota(part.begin(), part.end(), 0);
  const auto root = [&part](std::size_t v) {
    while (part[v] != v) v = part[v] = part[part[v]];
    return v;
  };
  for (const Value& named : elements->list()) {
    ConvexPart element;
    element.radius_ = radius_;
    std::vector<std::size_t> corners;
    for (const Value& place : named.list()) {
      const std::size_t k = corners.emplace_back(place.index(count()));
      element.add_vertex(x_[k], y_[k], z_[k]);
      part[root(k)] = root(corners[0]);
    }
    require(!corners.empty() && (!is_solid_ || corners.size() == 3), "an element of a surface has no such corners");
    if (is_solid_) faces_.push_back({corners[0], corners[1], corners[2]});
    elements_.push_back(std::move(element));
  }
  std::vector<bool> is_named(count());
  for (const Value& named : elements->list()) is_named[root(named.at(0).index(count()))] = true;
  for (std::size_t v = 0; v < count(); ++v)
    if (is_named[v]) seeds_.push_back(v);
  require(!is_solid_ || is_closed(faces_), "a solid has a border");
}

std::vector<Vector> ConvexPart::seeds() const {
  if (!is_hull()) return {Vector{}};  // the origin is in every core
  std::vector<Vector> seeds;
  for (const std::size_t v : seeds_) seeds.push_back(vertex(v));
  if (!has_elements_) seeds.push_back(vertex(0));
  return seeds;
}

Dyadic ConvexPart::farthest_along(const Vector& n) const {
  const std::array<double, 3> d = rough_direction(n);
  scratch_.assign(count(), 0);
  // The error of products is (2^-51 + 2^-53) of the largest coordinate and of sums 2^-53 of three times it, or in
  // underflow a few 2^-1074.
  const double wrong = largest_ * 0x1p-47 + 0x1p-1060;
  if (largest_ < kLargest)
    for (std::size_t k = 0; k < count(); ++k) scratch_[k] = d[0] * x_[k] + d[1] * y_[k] + d[2] * z_[k];
  return largest_of(scratch_, wrong, [&](std::size_t k) { return dot(n, vertex(k)); });
}

Dyadic ConvexPart::farthest_squared(const Vector& centre) const {
  std::array<double, 3> c;
  double largest = largest_;
  for (std::size_t k = 0; k < 3; ++k) {
    long power = 0;
    c[k] = centre[k].rough(power);
    c[k] = std::ldexp(c[k], static_cast<int>(std::clamp(power, -2000L, 2000L)));
    largest = std::max(largest, std::abs(c[k]));
  }
  scratch_.assign(count(), 0);
  if (largest < kLargest)
    for (std::size_t k = 0; k < count(); ++k) {
      const double dx = x_[k] - c[0], dy = y_[k] - c[1], dz = z_[k] - c[2];
      scratch_[k] = dx * dx + dy * dy + dz * dz;
    }
  // The error of a difference is 2^-51 of 2 `largest`, which is its maximum; of its square 2^-49 of 4 largest^2, and so
  // on.
  const double wrong = largest < kLargest ? largest * largest * 0x1p-44 + 0x1p-1060 : 0;
  return largest_of(scratch_, wrong, [&](std::size_t k) {
    const Vector way = vertex(k) - centre;
    return dot(way, way);
  });
}

Dyadic ConvexPart::support(const Vector& n) const {
  Dyadic core;
  if (core_ == Core::kHull) {
    core = farthest_along(n);
  } else if (core_ == Core::kHalfSpace) {
    require(n[0].sign() == 0 && n[1].sign() == 0 && n[2].sign() > 0, "a half-space reaches farther than any length");
  } else if (core_ == Core::kEllipsoid) {
    core = length_above({size_[0] * n[0], size_[1] * n[1], size_[2] * n[2]});
  } else {
    const Dyadic rim = size_[0] * length_above({n[0], n[1], Dyadic()}), along = size_[2] * n[2];
    core = core_ == Core::kCylinder ? rim + abs(along) : std::max(along, rim - along);
  }
  return radius_.sign() == 0 ? core : core + radius_ * length_above(n);
}

Dyadic ConvexPart::reach(const Vector& centre) const {
  require(core_ != Core::kHalfSpace, "a half-space is farther than any length");
  if (core_ == Core::kHull) return radius_ + root_above(farthest_squared(centre));
  const Dyadic around = core_ == Core::kEllipsoid ? std::max({size_[0], size_[1], size_[2]})
                                                  : length_above({size_[0], Dyadic(), size_[2]});
  return radius_ + length_above(centre) + around;
}

Dyadic ConvexPart::off(const Vector& p) const {
  if (core_ == Core::kHalfSpace) return p[2];
  if (core_ == Core::kEllipsoid) {
    // With s = |(p_x / a, p_y / b, p_z / c)| p / s lies on it: (s - 1) |p|, all times a b c.
    const Dyadic &a = size_[0], &b = size_[1], &c = size_[2], volume = a * b * c;
    const Dyadic s = length_above({p[0] * b * c, a * p[1] * c, a * b * p[2]});
    return quotient_above((s - volume) * length_above(p), volume);
  }
  const Dyadic &radius = size_[0], &half = size_[2], across = length_above({p[0], p[1], Dyadic()});
  require(abs(p[2]) <= half, "a point lies beyond the ends of its core");
  if (core_ == Core::kCylinder) return across - radius;
  return across - radius + quotient_above((half + p[2]) * radius, half + half);
}

}  // namespace clearance::certificate_oracle
