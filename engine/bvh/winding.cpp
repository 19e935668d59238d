// Winding number of a closed mesh around a point, by a ray from it along +x (crossing.h). All signs are exact.
#include <vector>

#include "engine/base/orientation.h"
#include "engine/bvh/crossing.h"
#include "engine/bvh/enclosure.h"
#include "engine/bvh/surface.h"

namespace clearance {

int winding_number(const Surface& surface, const Vec3d& p) {
  std::uint64_t visits = 0;
  return winding_number(surface, p, &visits);
}

int winding_number(const Surface& surface, const Vec3d& p, std::uint64_t* visits) {
  const Vec3d from_centre = p - surface.centre(), point = flushed(p);
  const std::span<const Surface::Node> nodes = surface.nodes();
  int sum = 0;
  std::vector<std::uint32_t> left{0};
  while (!left.empty()) {
    const std::uint32_t at = left.back();
    left.pop_back();
    ++*visits;
    const Surface::Node& node = nodes[at];
    if (ray_misses({node.low[0], node.low[1], node.low[2]}, {node.high[0], node.high[1], node.high[2]}, from_centre))
      continue;
    if (!node.is_leaf()) {
      left.push_back(node.right);
      left.push_back(at + 1);
      continue;
    }
    for (std::uint32_t t = node.begin(); t < node.end(); ++t) {
      const auto [a, b, c] = surface.corners(t);
      sum += crossing(flushed(a), flushed(b), flushed(c), point, orientation);
    }
  }
  return sum;
}

}  // namespace clearance
