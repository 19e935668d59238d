// Bound on the distance of a convex part from a surface or solid: the part is cut into tetrahedra, and these are
// divided until each is near enough to the mesh, or within it.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <queue>

#include "engine/base/fp_environment.h"
#include "engine/decomposition/fan.h"
#include "engine/decomposition/measure.h"
#include "engine/decomposition/prove.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kUp = 1 + 0x1p-44;  // exceeds the rounding of a few sums and roots
constexpr std::uint32_t kNoTriangle = 0xFFFFFFFFu;
constexpr std::size_t kMostTriangles = 24;  // maximum for tests of a tetrahedron one by one

using Corners = std::array<std::uint32_t, 4>;

class OuterBound {
 public:
  OuterBound(const Surface& exact_value, const ConvexPart& convex_part, const ProofEffort& effort)
      : exact_value_(exact_value), part_(convex_part), effort_(effort) {
    for (const Vec3d& v : exact_value.vertices()) reach_ = std::max(reach_, norm(v));
    Vec3d low = exact_value.vertices()[0], high = low;
    for (const Vec3d& v : exact_value.vertices())
      for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
    size_ = norm(high - low);
    reach_ = std::max(reach_, convex_part.rho);
    fine_ = 0x1p-40 * (size_ + convex_part.spread);
    measure_ = Measure(fine_);
  }

  ProvedLength run() {
    begin();
    while (!parts_.empty() && parts_.top().bound > stop_below() && measure_.count() < effort_.outer_distances) {
      const Part part = parts_.top();
      parts_.pop();
      divide(part);
    }
    return {parts_.empty() ? 0 : parts_.top().bound * kUp, met_};
  }

 private:
  struct Part {
    double bound;     // bound on its distance from the exact mesh, with the rounding of divisions
    double parents;   // bound of the tetrahedron it was cut from
    double off;       // bound on its distance from the tetrahedron of its corners
    Corners corners;  // of points_
    int generation;
    std::uint32_t cut;                         // a triangle of the mesh that cuts it, or kNoTriangle
    bool operator<(const Part& other) const {  // the largest bound is on top; among equal ones the oldest
      return bound != other.bound ? bound < other.bound : corners > other.corners;
    }
  };
  // A point, and its distance from the mesh.
  struct Known {
    Vec3d at;
    std::uint32_t triangle = kNoTriangle;  // the nearest, as computed
    double distance = kInf;                // from the exact mesh, rounded up
    bool is_inside = false;
  };

  double stop_below() const { return std::max(met_ * (1 + effort_.share), met_ + effort_.outer_of_size * size_); }

  void begin() {
    const std::optional<Fan> fan = fan_of(part_.vertices);
    is_within_ = fan.has_value();
    const Fan parts = fan ? *fan : box_around(part_);
    for (const Vec3d& v : parts.points) points_.push_back({v, kNoTriangle, kInf, false});
    for (const auto& corners : parts.parts) put({0, kInf, parts.off, corners, 0, kNoTriangle});
  }

  const Known& evaluate_point(std::uint32_t point) {
    Known& known = points_[point];
    if (known.triangle != kNoTriangle) return known;
    known.triangle = nearest_triangle(exact_value_, known.at);
    const Measure::Bounds d = measure_.to(exact_value_.corners(known.triangle), known.at);
    // A point that is proved apart from the nearest triangle lies on none.
    known.is_inside = exact_value_.is_solid() && d.lower > 0 && winding_number(exact_value_, known.at) != 0;
    known.distance = known.is_inside ? 0 : d.upper;
    if (!known.is_inside && d.lower > met_ && (is_within_ || measure_.to(part_, known.at).lower == 0)) met_ = d.lower;
    return known;
  }
  std::array<Vec3d, 4> places(const Corners& corners) const {
    return {points_[corners[0]].at, points_[corners[1]].at, points_[corners[2]].at, points_[corners[3]].at};
  }

  void put(Part part) {
    for (const std::uint32_t corner : part.corners) evaluate_point(corner);
    const std::array<Vec3d, 4> at = places(part.corners);
    const Vec3d middle = 0.25 * ((at[0] + at[1]) + (at[2] + at[3]));
    double radius = 0;
    for (const Vec3d& v : at) radius = std::max(radius, norm(v - middle) * kUp);
    if (!is_within_ && measure_.apart(at, part_) > part.off) return;  // it contains no point of the convex part
    part.bound = std::min(part.parents, (by_corners(part.corners, radius) + part.off) * kUp);
    if (part.bound > stop_below()) look_closer(part, at, middle, radius);
    if (part.bound > 0) parts_.push(part);
  }

  // The distance of any point from the mesh is at most a corner's plus that to the corner, and from one triangle, which
  // is convex, at most that of the farthest corner.
  double by_corners(const Corners& corners, double radius) {
    double least = kInf;
    for (const std::uint32_t corner : corners) {
      double across = 0;
      for (const std::uint32_t other : corners)
        across = std::max(across, norm(points_[other].at - points_[corner].at) * kUp);
      least = std::min(least, points_[corner].distance + std::min(across, 2 * radius));
    }
    std::array<std::uint32_t, 4> triangles;
    for (std::size_t k = 0; k < 4; ++k) triangles[k] = points_[corners[k]].triangle;
    std::sort(triangles.begin(), triangles.end());
    for (std::size_t k = 0; k < 4; ++k) {
      if (k > 0 && triangles[k] == triangles[k - 1]) continue;
      const auto triangle = exact_value_.corners(triangles[k]);
      double most = 0;
      for (const std::uint32_t corner : corners)
        if (most < least) most = std::max(most, measure_.to(triangle, points_[corner].at).upper);
      least = std::min(least, most);
    }
    return least;
  }

  // Tightens the bound by the centre, by a box without triangles, and by the triangles near it, one by one.
  void look_closer(Part& part, const std::array<Vec3d, 4>& at, const Vec3d& middle, double radius) {
    const auto take = [&part](double bound) { part.bound = std::min(part.bound, (bound + part.off) * kUp); };
    points_.push_back({middle, kNoTriangle, kInf, false});
    const Known centre = evaluate_point(static_cast<std::uint32_t>(points_.size() - 1));
    points_.pop_back();
    take(centre.distance + radius);
    if (!centre.is_inside || part.bound <= stop_below()) return;
    Vec3d low = at[0], high = at[0];
    for (const Vec3d& v : at)
      for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
    if (!triangles_that_meet(exact_value_, low, high, kMostTriangles, near_)) return;
    if (near_.empty()) return take(0);
    // The greatest depth of a triangle along its shortest way out of the tetrahedron.
    double deepest = fine_;
    for (const std::uint32_t t : near_) {
      const double depth = -measure_.gap(at, exact_value_.corners(t));
      if (!(depth > deepest)) continue;
      deepest = depth;
      part.cut = t;
      if (!(depth < radius)) return;  // or a NaN
    }
    // Shrunk about its centre by the share `by` it meets none.
    const double inner = inner_radius(at, middle, radius);
    if (!(inner > 0)) return;
    const double by = 2 * deepest / inner;
    if (by < 0.5) take(by * radius);
  }

  // Radius of a ball about the centre that is proved to fit into a tetrahedron, or 0 if that is too thin.
  double inner_radius(const std::array<Vec3d, 4>& at, const Vec3d& middle, double radius) const {
    if (!(radius > 0x1p-28 * reach_)) return 0;
    double least = kInf;
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3d &a = at[(k + 1) % 4], &b = at[(k + 2) % 4], &c = at[(k + 3) % 4];
      const Vec3d n = cross(b - a, c - a);
      const double area = norm(n), volume = std::abs(dot(n, middle - a));
      if (!(volume > 0x1p-20 * radius * radius * radius)) return 0;
      least = std::min(least, volume / area);
    }
    return 0.5 * least;
  }

  // Divides an edge at a triangle's plane, or the longest edge in the middle.
  void divide(const Part& part) {
    std::size_t from = 0, to = 1;
    double along = 0.5, longest = 0;
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = i + 1; j < 4; ++j)
        if (const double d = squared_norm(points_[part.corners[i]].at - points_[part.corners[j]].at); d > longest)
          longest = d, from = i, to = j;
    if (part.cut != kNoTriangle && part.generation % 4 != 3) at_plane(part, from, to, along);
    const Vec3d &u = points_[part.corners[from]].at, &v = points_[part.corners[to]].at;
    const Vec3d middle = u + (v - u) * along;
    const auto point = static_cast<std::uint32_t>(points_.size());
    points_.push_back({middle, kNoTriangle, kInf, false});
    const double off = (part.off + rounding_of_division(reach_)) * kUp;
    for (const std::size_t moved : {from, to}) {
      Part half{0, part.bound, off, part.corners, part.generation + 1, kNoTriangle};
      half.corners[moved] = point;
      put(half);
    }
  }
  void at_plane(const Part& part, std::size_t& from, std::size_t& to, double& along) const {
    const auto [a, b, c] = exact_value_.corners(part.cut);
    const Vec3d n = cross(b - a, c - a);
    std::array<double, 4> height;
    for (std::size_t k = 0; k < 4; ++k) height[k] = dot(n, points_[part.corners[k]].at - a);
    double widest = 0;
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j) {
        if (!(height[i] < 0 && height[j] > 0)) continue;
        const double there = -height[i] / (height[j] - height[i]);
        if (!(there > 0.01 && there < 0.99) || !(height[j] - height[i] > widest)) continue;
        widest = height[j] - height[i];
        from = i;
        to = j;
        along = there;
      }
  }

  const Surface& exact_value_;
  const ConvexPart& part_;
  const ProofEffort& effort_;
  double reach_ = 0, size_ = 0, fine_ = 0, met_ = 0;
  bool is_within_ = false;  // tetrahedra cover the convex part itself, not a box around it
  Measure measure_{0};
  std::vector<Known> points_;
  std::vector<std::uint32_t> near_;
  std::priority_queue<Part> parts_;
};

}  // namespace

ProvedLength prove_outer(const Surface& exact_value, const ConvexPart& convex_part, const ProofEffort& effort) {
  const FpEnvironment environment;
  return OuterBound(exact_value, convex_part, effort).run();
}

}  // namespace clearance
