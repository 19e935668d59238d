#include "mesh_rows.h"

#include <algorithm>
#include <cmath>

#include "fp_environment.h"

namespace clearance {

MeshRows::MeshRows(std::size_t vertex_count, std::span<const Triangle> triangles)
    : begin_(vertex_count + 1, 0), triangle_count_(triangles.size()) {
  for (const Triangle& t : triangles)
    for (const std::uint32_t i : t) ++begin_[i + 1];
  for (std::size_t v = 0; v < vertex_count; ++v) begin_[v + 1] += begin_[v];
  edges_.resize(begin_.back());
  std::vector<std::uint64_t> next(begin_.begin(), begin_.end() - 1);
  for (const Triangle& t : triangles)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
      edges_[next[a]++] = {b, c};
    }
  const auto count = static_cast<std::int64_t>(vertex_count);
#pragma omp parallel for schedule(static) if (count > 10000)
  for (std::int64_t v = 0; v < count; ++v)
    std::sort(edges_.begin() + static_cast<std::ptrdiff_t>(begin_[v]),
              edges_.begin() + static_cast<std::ptrdiff_t>(begin_[v + 1]),
              [](const Edge& a, const Edge& b) { return a.to < b.to; });
}

// Each edge from a is run along exactly once each way, and the corner across it is not above the triangle's plane.
bool MeshRows::is_convex_at(std::uint32_t a, std::span<const Vec3d> vertices, double tolerance) const {
  const std::span<const Edge> edges = row(a);
  if (edges.empty()) return false;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto [b, c] = edges[i];
    if (i > 0 && edges[i - 1].to == b) return false;
    const std::span<const Edge> back = row(b);
    const auto found =
        std::lower_bound(back.begin(), back.end(), a, [](const Edge& e, std::uint32_t to) { return e.to < to; });
    if (found == back.end() || found->to != a) return false;
    if (b < a) continue;  // its height is looked at from there
    const Vec3d normal = cross(vertices[b] - vertices[a], vertices[c] - vertices[a]);
    if (dot(normal, vertices[found->opposite] - vertices[a]) > tolerance * norm(normal)) return false;
  }
  return true;
}

bool MeshRows::is_convex(std::span<const Vec3d> vertices) const {
  const auto count = static_cast<std::int64_t>(vertices.size());
  if (count < 4 || triangle_count_ + 4 != 2 * vertices.size()) return false;  // a closed sphere: F = 2 V - 4
  Vec3d low = vertices[0], high = vertices[0];
  for (const Vec3d& v : vertices)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], v[k]);
      high[k] = std::max(high[k], v[k]);
    }
  const double tolerance = 1e-6 * norm(high - low);
  bool convex = true;
#pragma omp parallel reduction(&& : convex) if (count > 10000)
  {
    const FpEnvironment environment;
#pragma omp for schedule(dynamic, 4096)
    for (std::int64_t v = 0; v < count; ++v)
      convex = convex && is_convex_at(static_cast<std::uint32_t>(v), vertices, tolerance);
  }
  if (!convex) return false;

  // One surface, not several: every vertex is reached from the first.
  std::vector<char> seen(vertices.size(), 0);
  std::vector<std::uint32_t> stack = {0};
  seen[0] = 1;
  std::size_t reached = 1;
  while (!stack.empty()) {
    const std::uint32_t v = stack.back();
    stack.pop_back();
    for (const Edge& e : row(v))
      if (!seen[e.to]) {
        seen[e.to] = 1;
        ++reached;
        stack.push_back(e.to);
      }
  }
  return reached == vertices.size();
}

}  // namespace clearance
