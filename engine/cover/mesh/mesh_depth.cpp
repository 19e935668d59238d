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

/// Any nearest point gives a valid upper bound, and any direction to it a lower one.
DistanceBounds to_triangle(const std::array<Vec3d, 3>& t, const Vec3d& p) {
  const std::array<double, 3> weight = nearest_weights(t, p);
  const Vec3d nearest = t[0] * weight[0] + t[1] * weight[1] + t[2] * weight[2], n = p - nearest;
  const double away = norm(n), rounding = 8 * kRounding * (norm(p) + norm(t[0]) + norm(t[1]) + norm(t[2])) + kUnderflow;
  double low = std::numeric_limits<double>::infinity();
  for (const Vec3d& v : t) low = std::min(low, dot(n, p - v));
  return {away > kUnderflow ? low / away - rounding : 0, away * kUp + rounding};
}

class DepthSearch {
 public:
  DepthSearch(const Surface& surface, const Vec3d& p)
      : surface_(surface),
        p_(p),
        from_centre_(p - surface.centre()),
        rounding_(4 * kRounding * (norm(p) + norm(surface.centre())) + kUnderflow) {}

  DistanceBounds run() {
    std::vector<Open> open{{0, gap(0)}};
    while (!open.empty()) {
      const Open next = open.back();
      open.pop_back();
      if (next.gap >= found_.high) continue;
      const Surface::Node& node = surface_.nodes()[next.node];
      if (node.is_leaf()) {
        for (std::uint32_t e = node.begin(); e < node.end(); ++e) take(to_triangle(surface_.corners(e), p_));
        continue;
      }
      Open far{next.node + 1, gap(next.node + 1)}, near{node.right, gap(node.right)};
      if (far.gap < near.gap) std::swap(far, near);
      open.push_back(far);
      open.push_back(near);
    }
    return found_;
  }

 private:
  struct Open {
    std::uint32_t node;
    double gap;  // lower bound on the distance from its elements
  };

  double gap(std::uint32_t at) const {
    const Surface::Node& node = surface_.nodes()[at];
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const double out = std::max({double{node.low[i]} - from_centre_[k], from_centre_[k] - double{node.high[i]}, 0.0});
      sum += out * out;
    }
    return std::sqrt(sum) * (1 - 0x1p-48) - rounding_;
  }
  void take(const DistanceBounds& of_element) {
    found_.low = std::min(found_.low, of_element.low);
    found_.high = std::min(found_.high, of_element.high);
  }

  const Surface& surface_;
  const Vec3d p_, from_centre_;
  const double rounding_;
  DistanceBounds found_{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
};

}  // namespace

double depth_in_mesh(const Surface& surface, const Vec3d& c) {
  const DistanceBounds distance = DepthSearch(surface, c).run();
  // winding_number() needs a point that is farther than 1e-59 m from the triangles.
  if (surface.is_solid() && distance.low > 1e-50 && winding_number(surface, c) != 0) return distance.low;
  return -distance.high;
}

}  // namespace clearance
