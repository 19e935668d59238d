// Construction of the tree over a mesh's elements: halves the list recursively, down to a few elements.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/bvh/surface.h"

namespace clearance {

/// The box around all that it took; low > high if empty.
struct Extremes {
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  Vec3d low{kInf, kInf, kInf}, high{-kInf, -kInf, -kInf};

  void take(const Vec3d& v) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], v[k]);
      high[k] = std::max(high[k], v[k]);
    }
  }
  void take(const Extremes& other) {
    take(other.low);
    take(other.high);
  }
  Vec3d middle() const { return 0.5 * low + 0.5 * high; }
  int longest() const {
    const Vec3d size = high - low;
    return size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  }
};

namespace halving {

template <class Elements>
auto build(Elements& elements, std::uint32_t begin, std::uint32_t end, std::vector<Surface::Node>& nodes) {
  const std::size_t at = nodes.size();
  nodes.push_back({{}, {}, 0, 0});
  const auto close = [&](const auto& box) {
    elements.close(box, nodes[at].low, nodes[at].high);
    return box;
  };
  if (end - begin <= Surface::kLeafElements) {
    nodes[at].few = begin * Surface::kLeafElements + (end - begin - 1);
    return close(elements.box(begin, end));
  }
  const std::uint32_t middle = elements.split(begin, end);
  auto box = build(elements, begin, middle, nodes);
  nodes[at].right = static_cast<std::uint32_t>(nodes.size());
  box.take(build(elements, middle, end, nodes));
  return close(box);
}

}  // namespace halving

/// Builds the nodes over at least one element, and sorts the elements in the order of the leaves.
/// \param elements has box(begin, end), the box around some of them; split(begin, end), which partitions them and
/// returns where the second half begins; close(box, low, high), which rounds a box outward relative to the mesh's
/// centre
template <class Elements>
std::vector<Surface::Node> halve(Elements& elements, std::uint32_t count) {
  std::vector<Surface::Node> nodes;
  nodes.reserve(count);
  halving::build(elements, 0, count, nodes);
  nodes.shrink_to_fit();
  return nodes;
}

}  // namespace clearance
