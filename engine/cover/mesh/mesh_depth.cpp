#include "engine/cover/mesh/mesh_depth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace clearance {

namespace {

constexpr double kUp = 1 + 0x1p-48;    // more than the rounding of a length
constexpr double kRounding = 0x1p-49;  // and of a sum of three products, relative to their magnitudes
constexpr double kUnderflow = 1e-150;  // and of a length whose squares are too small, in metres

/// Bounds on the distance of a point from a set.
struct DistanceBounds {
  double low, high;
};

/// Weights of a triangle's corners at about the point nearest to `p`, not negative (C. Ericson, Real-Time Collision
/// Detection, 2005).
std::array<double, 3> nearest_weights(const std::array<Vec3d, 3>& t, const Vec3d& p) {
  const Vec3d ab = t[1] - t[0], ac = t[2] - t[0], bc = t[2] - t[1];
  const double d1 = dot(ab, p - t[0]), d2 = dot(ac, p - t[0]), d3 = dot(ab, p - t[1]), d4 = dot(ac, p - t[1]),
               d5 = dot(ab, p - t[2]), d6 = dot(ac, p - t[2]);
  const auto share = [](double part, double rest) {
    const double sum = part + rest;
    return sum > 0 ? std::clamp(part / sum, 0.0, 1.0) : 0.0;
  };
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = share(d1, -d3);
    return {1 - v, v, 0};
  }
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = share(d2, -d6);
    return {1 - w, 0, w};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double w = squared_norm(bc) > 0 ? share(d4 - d3, d5 - d6) : 0;
    return {0, 1 - w, w};
  }
  const double v = share(vb, va + vc), w = std::min(share(vc, va + vb), 1 - v);
  return {std::max(1 - v - w, 0.0), v, w};
}

/// Search for the triangle, or the point of a cloud, nearest to a point. Any point of a triangle gives a valid upper
/// bound, and any direction to it a lower one.
class DepthSearch {
 public:
  DepthSearch(const Surface& surface, const Vec3d& p, std::uint32_t& near)
      : surface_(surface),
        near_(near),
        p_(p),
        from_centre_(p - surface.centre()),
        rounding_(8 * kRounding * (norm(p) + 3 * reach_of(surface)) + kUnderflow) {}

  /// Ends once the upper bound is no greater than `enough`.
  DistanceBounds run(double enough) {
    take(near_ < surface_.size() ? near_ : 0);
    static thread_local std::vector<Open> open;
    open.assign(1, {0, squared_gap(0)});
    while (!open.empty() && found_.high > enough) {
      const Open next = open.back();
      open.pop_back();
      if (next.squared_gap >= far_) continue;
      const Surface::Node& node = surface_.nodes()[next.node];
      if (node.is_leaf()) {
        for (std::uint32_t e = node.begin(); e < node.end(); ++e) take(e);
        continue;
      }
      Open far{next.node + 1, squared_gap(next.node + 1)}, near{node.right, squared_gap(node.right)};
      if (far.squared_gap < near.squared_gap) std::swap(far, near);
      open.push_back(far);
      open.push_back(near);
    }
    return found_;
  }

 private:
  struct Open {
    std::uint32_t node;
    double squared_gap;  // of its box
  };

  /// Bound on the distance of the corners from the origin.
  static double reach_of(const Surface& surface) {
    const Surface::Node& root = surface.nodes()[0];
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double most = std::max(std::abs(double{root.low[k]}), std::abs(double{root.high[k]}));
      sum += most * most;
    }
    return (norm(surface.centre()) + std::sqrt(sum)) * kUp;
  }
  double squared_gap(std::uint32_t at) const {
    const Surface::Node& node = surface_.nodes()[at];
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const double out = std::max({double{node.low[i]} - from_centre_[k], from_centre_[k] - double{node.high[i]}, 0.0});
      sum += out * out;
    }
    return sum;
  }
  void take(std::uint32_t element) {
    if (surface_.is_cloud()) return take_upper(norm(p_ - surface_.point(element)), element);
    const std::array<Vec3d, 3> t = surface_.corners(element);
    const std::array<double, 3> weight = nearest_weights(t, p_);
    const Vec3d nearest = t[0] * weight[0] + t[1] * weight[1] + t[2] * weight[2], n = p_ - nearest;
    double low = std::numeric_limits<double>::infinity();
    for (const Vec3d& v : t) low = std::min(low, dot(n, p_ - v));
    const double squared = squared_norm(n);
    if (low > 0 && squared > kUnderflow * kUnderflow && low * low > far_ * squared) return;  // another one is nearer
    const double away = std::sqrt(squared);
    found_.low = std::min(found_.low, away > kUnderflow ? low / away - rounding_ : 0);
    take_upper(away, element);
  }
  void take_upper(double away, std::uint32_t element) {
    const double high = away * kUp + rounding_;
    if (!(high < found_.high)) return;
    found_.high = high;
    near_ = element;
    far_ = (high + rounding_) * (high + rounding_) * (1 + 0x1p-46);
  }

  const Surface& surface_;
  std::uint32_t& near_;
  const Vec3d p_, from_centre_;
  const double rounding_;  // of a distance from a triangle or box
  DistanceBounds found_{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  double far_ = std::numeric_limits<double>::infinity();  // squared distance from which on nothing is nearer
};

}  // namespace

double depth_in_mesh(const Surface& surface, const Vec3d& c, double enough, std::uint32_t& near) {
  const DistanceBounds distance = DepthSearch(surface, c, near).run(enough);
  // winding_number() needs a point that is farther than 1e-59 m from the triangles.
  if (surface.is_solid() && distance.low > std::max(enough, 1e-50) && winding_number(surface, c) != 0)
    return distance.low;
  return -distance.high;
}

double depth_in_cloud(const Surface& cloud, const Vec3d& c, std::uint32_t& near) {
  const double nearest = DepthSearch(cloud, c, near).run(-std::numeric_limits<double>::infinity()).high;
  // The box about a point holds a ball of half its edge.
  return (0.5 * cloud.edge() - cloud.rounding()) * (1 - 0x1p-50) - nearest;
}

}  // namespace clearance
