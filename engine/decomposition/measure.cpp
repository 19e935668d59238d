#include "engine/decomposition/measure.h"

#include <algorithm>
#include <cmath>

#include "engine/bvh/leaves_in_box.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
const PoseMatrix kHere{Mat3d::identity(), {0, 0, 0}, {}};

// Squared distance of p to a triangle, by the regions of C. Ericson, "Real-Time Collision Detection" (2004), sect.
// 5.1.5. It only selects triangles.
double squared_distance(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
  const auto to_edge = [&p](const Vec3d& u, const Vec3d& v) {
    const Vec3d e = v - u;
    const double length = squared_norm(e), along = length > 0 ? std::clamp(dot(p - u, e) / length, 0.0, 1.0) : 0.0;
    return squared_norm(p - (u + along * e));
  };
  const double edges = std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
  const Vec3d n = cross(b - a, c - a);
  const double length = squared_norm(n);
  if (!(length > 0)) return edges;
  const auto is_within = [&](const Vec3d& u, const Vec3d& v) { return dot(cross(v - u, p - u), n) >= 0; };
  if (!is_within(a, b) || !is_within(b, c) || !is_within(c, a)) return edges;
  const double height = dot(n, p - a);
  return std::min(edges, height * height / length);
}

}  // namespace

Measure::Bounds Measure::evaluate(const ConvexPart& a, const ConvexPart& b) {
  ++count_;
  NarrowLimits limits;
  limits.abs_tol = fine_;
  limits.rel_tol = 1e-3;
  const NarrowAnswer answer = narrow_phase(a, kHere, b, kHere, limits);
  return {std::max(answer.bounds.lower, 0.0), std::max(answer.bounds.upper, 0.0), answer.normal};
}

Measure::Bounds Measure::to(const ConvexPart& part, const Vec3d& p) {
  remake_part(parts_[0], {&p, 1}, 0);
  return evaluate(part, parts_[0]);
}

Measure::Bounds Measure::to(std::span<const Vec3d> corners, const Vec3d& p) {
  remake_part(parts_[1], corners, 0);
  return to(parts_[1], p);
}

double Measure::apart(std::span<const Vec3d> corners, const ConvexPart& part) {
  remake_part(parts_[1], corners, 0);
  return evaluate(part, parts_[1]).lower;
}

double Measure::gap(std::span<const Vec3d> a, std::span<const Vec3d> b) {
  ++count_;
  remake_part(parts_[0], a, 0);
  remake_part(parts_[1], b, 0);
  NarrowLimits limits;
  limits.abs_tol = fine_;
  limits.rel_tol = 1e-3;
  limits.signed_distance = true;
  return narrow_phase(parts_[0], kHere, parts_[1], kHere, limits).bounds.lower;
}

std::uint32_t nearest_triangle(const Surface& surface, const Vec3d& p) {
  const std::span<const Surface::Node> nodes = surface.nodes();
  const Vec3d from_centre = p - surface.centre();
  const auto squared_gap = [&](std::uint32_t at) {
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const double low = nodes[at].low[static_cast<std::size_t>(k)], high = nodes[at].high[static_cast<std::size_t>(k)];
      const double gap = std::max({0.0, low - from_centre[k], from_centre[k] - high});
      sum += gap * gap;
    }
    return sum;
  };
  double best = kInf;
  std::uint32_t nearest = 0;
  struct Left {
    double gap;
    std::uint32_t at;
  };
  std::vector<Left> left{{squared_gap(0), 0}};
  while (!left.empty()) {
    const auto [gap, at] = left.back();
    left.pop_back();
    if (!(gap < best)) continue;
    const Surface::Node& node = nodes[at];
    if (node.is_leaf()) {
      for (std::uint32_t t = node.begin(); t < node.end(); ++t) {
        const auto [a, b, c] = surface.corners(t);
        if (const double d = squared_distance(a, b, c, p); d < best) best = d, nearest = t;
      }
      continue;
    }
    Left first{squared_gap(at + 1), at + 1}, second{squared_gap(node.right), node.right};
    if (first.gap < second.gap) std::swap(first, second);
    left.push_back(first);
    left.push_back(second);  // the nearer one comes next
  }
  return nearest;
}

bool triangles_that_meet(const Surface& surface, const Vec3d& low, const Vec3d& high, std::size_t most,
                         std::vector<std::uint32_t>& found) {
  found.clear();
  return visit_leaves(surface, low, high, [&](const Surface::Node& leaf) {
    for (std::uint32_t t = leaf.begin(); t < leaf.end(); ++t) {
      const auto [a, b, c] = surface.corners(t);
      bool meets = true;
      for (int k = 0; k < 3; ++k)
        meets = meets && std::min({a[k], b[k], c[k]}) <= high[k] && std::max({a[k], b[k], c[k]}) >= low[k];
      if (!meets) continue;
      if (found.size() == most) return false;
      found.push_back(t);
    }
    return true;
  });
}

}  // namespace clearance
