#include "engine/bvh/mesh_components.h"

#include <algorithm>
#include <numeric>

#include "engine/base/dedupe.h"

namespace clearance {

namespace {

bool has_busy_edges(std::span<const std::uint32_t> place, std::span<const Triangle> triangles) {
  std::vector<std::uint64_t> edges;
  edges.reserve(3 * triangles.size());
  for (const Triangle& t : triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = place[t[k]], b = place[t[(k + 1) % 3]];
      if (a != b) edges.push_back(std::uint64_t{std::min(a, b)} << 32 | std::max(a, b));
    }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 2; i < edges.size(); ++i)
    if (edges[i] == edges[i - 2]) return true;
  return false;
}

}  // namespace

MeshComponents components_of(std::span<const Vec3d> vertices, std::span<const Triangle> triangles) {
  const std::vector<std::uint32_t> place = unique_positions(vertices).index;
  std::vector<std::uint32_t> above(vertices.size());  // a forest: each vertex's component is that of its root
  std::iota(above.begin(), above.end(), 0);
  const auto root = [&](std::uint32_t v) {
    while (above[v] != v) v = above[v] = above[above[v]];
    return v;
  };
  for (const Triangle& t : triangles)
    for (std::size_t k = 1; k < 3; ++k) above[root(place[t[k]])] = root(place[t[0]]);
  constexpr std::uint32_t kNone = 0xFFFFFFFFu;
  std::vector<std::uint32_t> number(vertices.size(), kNone);
  MeshComponents components;
  components.has_busy_edges = has_busy_edges(place, triangles);
  const Vec3d centre = vertices[triangles[0][0]];
  for (const Triangle& t : triangles) {
    std::uint32_t& n = number[root(place[t[0]])];
    if (n == kNone) {
      n = static_cast<std::uint32_t>(components.all.size());
      components.all.emplace_back();
    }
    components.of.push_back(n);
    MeshComponent& component = components.all[n];
    const Vec3d a = vertices[t[0]] - centre, b = vertices[t[1]] - centre, c = vertices[t[2]] - centre;
    component.volume += dot(a, cross(b, c)) / 6;
    component.area += norm(cross(b - a, c - a)) / 2;
    for (const Vec3d& v : {a, b, c})
      for (int k = 0; k < 3; ++k) {
        component.low[k] = std::min(component.low[k], v[k]);
        component.high[k] = std::max(component.high[k], v[k]);
      }
  }
  return components;
}

}  // namespace clearance
