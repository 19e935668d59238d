// How the tree over a surface's elements is made: halved at the middle one along the longest side, and so on.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/surface/surface.h"

namespace clearance {

/// The box around what it took; low > high: nothing.
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

// The float nearest to x that is not above it; not below it.
inline float float_below(double x) {
  const auto f = static_cast<float>(x);
  return f <= x ? f : std::nextafter(f, -std::numeric_limits<float>::infinity());
}
inline float float_above(double x) {
  return -float_below(-x);
}

template <class Elements>
Extremes build(Elements& elements, std::uint32_t begin, std::uint32_t end, std::vector<Surface::Node>& nodes) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  const std::size_t at = nodes.size();
  nodes.push_back({{}, {}, 0, 0});
  Extremes box;
  if (end - begin <= Surface::kLeafElements) {
    nodes[at].few = begin * Surface::kLeafElements + (end - begin - 1);
    box = elements.box(begin, end);
  } else {
    const std::uint32_t half = (end - begin) / 2;
    elements.split(begin, begin + half, end);
    box = build(elements, begin, begin + half, nodes);
    nodes[at].right = static_cast<std::uint32_t>(nodes.size());
    box.take(build(elements, begin + half, end, nodes));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    // What is measured from the centre was rounded: half a unit of float64, far less than one of float32.
    nodes[at].low[k] = std::nextafter(float_below(box.low[static_cast<int>(k)]), -kInf);
    nodes[at].high[k] = std::nextafter(float_above(box.high[static_cast<int>(k)]), kInf);
  }
  return box;
}

}  // namespace halving

/// The nodes over so many elements, at least one, which are brought into the order of the leaves. \param elements has
/// box(begin, end), around some of them as seen from the surface's centre, and split(begin, middle, end), which brings
/// those of the lower half before the others.
template <class Elements>
std::vector<Surface::Node> halve(Elements& elements, std::uint32_t count) {
  std::vector<Surface::Node> nodes;
  nodes.reserve(count);
  halving::build(elements, 0, count, nodes);
  nodes.shrink_to_fit();
  return nodes;
}

}  // namespace clearance
