#include "engine/mesh_distance/subtree_bounds.h"

#include <algorithm>
#include <limits>

#include "engine/bvh/surface.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kMostCorners = 64;  // maximum for a part whose corners are tested one by one

// Slab of a node; null for anything else.
const Surface::Slab* slab_of(const Surface& surface, std::uint32_t at) {
  return at >> 31 || surface.is_cloud() ? nullptr : &surface.slabs()[at];
}
// Reach of a slab along a multiple of its normal.
double reach_across(const Surface::Slab& slab, double times, const Vec3d& centre) {
  return times * (dot(slab.normal(), centre) + double{times > 0 ? slab.high : slab.low});
}

}  // namespace

PartBounds part_bounds_of(const Body& body, Subtree subtree, const BoxBounds& bounds, std::array<Vec3d, 3>& scratch) {
  const ConvexPart& whole = *body.parts[subtree.part];
  const std::uint32_t at = subtree.at;
  PartBounds part{bounds.centre, bounds.half};
  if (at == kNone) {
    if (!whole.primitive && whole.count() <= kMostCorners) part.corners = whole.vertices;
  } else if (subtree.is_element() && !whole.surface->is_cloud()) {
    scratch = whole.surface->corners(at & ~Subtree::kElement);
    part.corners = scratch;
    const Vec3d normal = cross(scratch[1] - scratch[0], scratch[2] - scratch[0]);
    if (const double length = norm(normal); length > 0 && length < kInf) {
      part.normal = normal * (1 / length);
      const double at_corner[] = {dot(part.normal, scratch[0]), dot(part.normal, scratch[1]),
                                  dot(part.normal, scratch[2])};
      part.low = std::min({at_corner[0], at_corner[1], at_corner[2]});
      part.high = std::max({at_corner[0], at_corner[1], at_corner[2]});
    }
  } else if (const Surface::Slab* const slab = slab_of(*whole.surface, at)) {
    part.normal = slab->normal();
    const double centre = dot(part.normal, whole.surface->centre());
    part.low = centre + double{slab->low};
    part.high = centre + double{slab->high};
  }
  return part;
}

double reach_of(const Body& body, Subtree subtree, const BoxBounds& box, const Vec3d& n) {
  const Surface* const surface = body.parts[subtree.part]->surface.get();
  const std::uint32_t at = subtree.at;
  const auto of_elements = [&](std::uint32_t begin, std::uint32_t end) {
    double most = -kInf;
    if (surface->is_cloud()) {
      const double half = 0.5 * double{surface->edge()} + surface->rounding();
      for (std::uint32_t i = begin; i < end; ++i) most = std::max(most, dot(n, surface->point(i)));
      return most + half * (std::abs(n.x) + std::abs(n.y) + std::abs(n.z));
    }
    for (std::uint32_t t = begin; t < end; ++t)
      for (const std::uint32_t corner : surface->triangles()[t])
        most = std::max(most, dot(n, surface->vertices()[corner]));
    return most;
  };
  if (at != kNone && subtree.is_element()) return of_elements(at & ~Subtree::kElement, (at & ~Subtree::kElement) + 1);
  if (at != kNone && surface->nodes()[at].is_leaf())
    return of_elements(surface->nodes()[at].begin(), surface->nodes()[at].end());
  const double by_box = dot(n, box.centre) + dot(absolute_of(n), box.half);
  if (at == kNone || surface->is_cloud()) return by_box;
  // The component of n along the slab's normal reaches no farther than its plane, and the rest of n no farther than the
  // box.
  const Surface::Slab& slab = surface->slabs()[at];
  const Vec3d m = slab.normal();
  const double along = dot(n, m);
  const Vec3d rest = n - along * m;
  return std::min(
      by_box, dot(rest, box.centre) + dot(absolute_of(rest), box.half) + reach_across(slab, along, surface->centre()));
}

NodesBelow::NodesBelow(const Surface& surface, std::uint32_t node) {
  for (const std::uint32_t child : {node + 1, surface.nodes()[node].right}) {
    const Surface::Node& half = surface.nodes()[child];
    at[count++] = half.is_leaf() ? child : child + 1;
    if (!half.is_leaf()) at[count++] = half.right;
  }
  columns.take(surface, at, count);
}

ElementsBelow::ElementsBelow(const Surface& surface, std::uint32_t leaf) {
  const std::uint32_t begin = surface.nodes()[leaf].begin(), end = surface.nodes()[leaf].end();
  count = end - begin;
  for (std::uint32_t k = 0; k < count; ++k) at[k] = (begin + k) | Subtree::kElement;
  columns.take(surface, begin, end);
}

}  // namespace clearance
