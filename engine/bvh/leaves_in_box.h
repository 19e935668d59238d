// Leaves of a mesh's tree that may touch a box.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/bvh/surface.h"

namespace clearance {

/// Visits leaves whose boxes touch that from `low` to `high` (metres, in the mesh's frame), until `visit(node)` returns
/// false. Returns whether none did.
template <class Visit>
bool visit_leaves(const Surface& surface, const Vec3d& low, const Vec3d& high, const Visit& visit) {
  const std::span<const Surface::Node> nodes = surface.nodes();
  // Both are rounded by less than the outward rounding of a box's corners.
  const Vec3d from = low - surface.centre(), to = high - surface.centre();
  std::vector<std::uint32_t> left{0};
  while (!left.empty()) {
    const std::uint32_t at = left.back();
    left.pop_back();
    const Surface::Node& node = nodes[at];
    if (to.x < node.low[0] || from.x > node.high[0] || to.y < node.low[1] || from.y > node.high[1] ||
        to.z < node.low[2] || from.z > node.high[2])
      continue;
    if (node.is_leaf()) {
      if (!visit(node)) return false;
      continue;
    }
    left.push_back(node.right);
    left.push_back(at + 1);
  }
  return true;
}

}  // namespace clearance
