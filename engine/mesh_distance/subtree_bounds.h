// Bounds of a subtree of one body's part: a node of its tree of boxes, one of its triangles or points, or a convex part.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "engine/mesh_distance/part_gaps.h"
#include "engine/scene/scene.h"

namespace clearance {

/// A subtree of a body's part: `at` is a node, an element with the flag kElement, or kNone for an exact part.
struct Subtree {
  static constexpr std::uint32_t kElement = 1u << 31;

  std::uint32_t part, at;

  bool is_element() const { return (at & kElement) != 0; }  // an exact part, too
};

/// A box, in the axes of its body or of another.
struct BoxBounds {
  Vec3d centre{0, 0, 0}, half{0, 0, 0};
};

inline Vec3d absolute_of(const Vec3d& v) {
  return {std::abs(v.x), std::abs(v.y), std::abs(v.z)};
}

inline BoxBounds bounds_of(const Body& body, Subtree subtree) {
  const ConvexPart& p = *body.parts[subtree.part];
  const std::uint32_t at = subtree.at;
  if (at == kNone) return {p.centre, p.half};
  const Surface& surface = *p.surface;
  if (subtree.is_element()) {
    if (surface.is_cloud()) {
      const double half = 0.5 * double{surface.edge()} + surface.rounding();
      return {surface.point(at & ~Subtree::kElement), {half, half, half}};
    }
    const auto [u, v, w] = surface.corners(at & ~Subtree::kElement);
    BoxBounds bounds;
    for (int k = 0; k < 3; ++k) {
      const double low = std::min({u[k], v[k], w[k]}), high = std::max({u[k], v[k], w[k]});
      bounds.centre[k] = 0.5 * low + 0.5 * high;
      bounds.half[k] = 0.5 * high - 0.5 * low;
    }
    return bounds;
  }
  const Surface::Node& node = surface.nodes()[at];
  BoxBounds bounds;
  for (int k = 0; k < 3; ++k) {
    const double low = node.low[static_cast<std::size_t>(k)], high = node.high[static_cast<std::size_t>(k)];
    bounds.centre[k] = surface.centre()[k] + (0.5 * low + 0.5 * high);
    bounds.half[k] = 0.5 * high - 0.5 * low;
  }
  return bounds;
}

/// \param bounds of the subtree
/// \param scratch receives the corners of a triangle
PartBounds part_bounds_of(const Body& body, Subtree subtree, const BoxBounds& bounds, std::array<Vec3d, 3>& scratch);
/// Upper bound on the reach of a subtree along a direction, in the axes of its body: of the elements in a leaf, and of
/// the box otherwise.
double reach_of(const Body& body, Subtree subtree, const BoxBounds& box, const Vec3d& n);

/// Children of a node: the nodes two levels below it, or leaves before.
struct NodesBelow {
  std::uint32_t at[kPartLanes], count = 0;
  NodeColumns columns;

  NodesBelow(const Surface& surface, std::uint32_t node);
};
/// Elements of a leaf.
struct ElementsBelow {
  std::uint32_t at[kPartLanes], count;
  ElementColumns columns;

  ElementsBelow(const Surface& surface, std::uint32_t leaf);
};

}  // namespace clearance
