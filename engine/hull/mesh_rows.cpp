#include "engine/hull/mesh_rows.h"

#include <algorithm>
#include <cmath>

#include "engine/base/fp_environment.h"
#include "engine/base/orientation.h"

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

// Whether triangles use each edge from a exactly once each way, and good(a, b, c, d) holds for its triangle a, b, c and
// the corner d across it.
template <class Good>
bool MeshRows::is_good_at(std::uint32_t a, const Good& good) const {
  const std::span<const Edge> edges = row(a);
  if (edges.empty()) return false;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto [b, c] = edges[i];
    if (i > 0 && edges[i - 1].to == b) return false;
    const std::span<const Edge> back = row(b);
    const auto found =
        std::lower_bound(back.begin(), back.end(), a, [](const Edge& e, std::uint32_t to) { return e.to < to; });
    if (found == back.end() || found->to != a) return false;
    if (b > a && !good(a, b, c, found->opposite)) return false;  // the other way is tested from there
  }
  return true;
}

template <class Good>
bool MeshRows::is_good_sphere(const Good& good) const {
  const auto count = static_cast<std::int64_t>(begin_.size()) - 1;
  if (count < 4 || triangle_count_ + 4 != 2 * static_cast<std::size_t>(count)) return false;  // a sphere: F = 2 V - 4
  bool all = true;
#pragma omp parallel reduction(&& : all) if (count > 10000)
  {
    const FpEnvironment environment;
#pragma omp for schedule(dynamic, 4096)
    for (std::int64_t v = 0; v < count; ++v) all = all && is_good_at(static_cast<std::uint32_t>(v), good);
  }
  if (!all) return false;

  // One surface, not several: every vertex is reached from the first.
  std::vector<char> seen(static_cast<std::size_t>(count), 0);
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
  return reached == seen.size();
}

bool MeshRows::is_convex(std::span<const Vec3d> vertices) const {
  if (vertices.empty()) return false;
  Vec3d low = vertices[0], high = vertices[0];
  for (const Vec3d& v : vertices)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], v[k]);
      high[k] = std::max(high[k], v[k]);
    }
  const double tolerance = 1e-6 * norm(high - low);
  return is_good_sphere([&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    const Vec3d normal = cross(vertices[b] - vertices[a], vertices[c] - vertices[a]);
    return dot(normal, vertices[d] - vertices[a]) <= tolerance * norm(normal);
  });
}

bool MeshRows::is_exactly_convex(std::span<const Vec3d> vertices) const {
  if (!std::all_of(vertices.begin(), vertices.end(), orientation_applies)) return false;
  return is_good_sphere([&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    const Vec3d ab = vertices[b] - vertices[a], ac = vertices[c] - vertices[a];
    return norm(cross(ab, ac)) > 1e-9 * norm(ab) * norm(ac) &&
           orientation(vertices[a], vertices[b], vertices[c], vertices[d]) <= 0;
  });
}

bool MeshRows::is_sphere() const {
  return is_good_sphere([](auto...) { return true; });
}

}  // namespace clearance
