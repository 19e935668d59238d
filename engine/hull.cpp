#include "hull.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "dedupe.h"
#include "digest.h"

namespace clearance {

namespace {

struct Adjacency {
  std::vector<std::uint32_t> begin, neighbours;
};

// Neighbour lists from the edges of triangles. Empty if some vertex would be left without a neighbour.
Adjacency adjacency_of(std::span<const Triangle> triangles, std::size_t vertex_count) {
  Adjacency out;
  std::vector<std::uint32_t> begin(vertex_count + 1, 0);
  const auto each_edge = [&](auto&& visit) {
    for (const Triangle& t : triangles)
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t a = t[k], b = t[(k + 1) % 3];
        if (a == b) continue;
        visit(a, b);
        visit(b, a);
      }
  };
  each_edge([&](std::uint32_t a, std::uint32_t) { ++begin[a + 1]; });
  for (std::size_t v = 0; v < vertex_count; ++v) {
    if (begin[v + 1] == 0) return out;
    begin[v + 1] += begin[v];
  }
  std::vector<std::uint32_t> raw(begin.back()), next(begin.begin(), begin.end() - 1);
  each_edge([&](std::uint32_t a, std::uint32_t b) { raw[next[a]++] = b; });
  out.begin.reserve(vertex_count + 1);
  out.neighbours.reserve(raw.size() / 2);
  out.begin.push_back(0);
  for (std::size_t v = 0; v < vertex_count; ++v) {  // an inner edge was seen from both of its faces
    std::sort(raw.begin() + begin[v], raw.begin() + begin[v + 1]);
    for (std::uint32_t i = begin[v]; i < begin[v + 1]; ++i)
      if (i == begin[v] || raw[i] != raw[i - 1]) out.neighbours.push_back(raw[i]);
    out.begin.push_back(static_cast<std::uint32_t>(out.neighbours.size()));
  }
  return out;
}

void check_vertices(std::span<const Vec3d> vertices) {
  if (vertices.empty()) throw std::invalid_argument("a piece needs at least one vertex");
  for (std::size_t i = 0; i < vertices.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (!(std::abs(vertices[i][k]) <= kMaxCoordinate))
        throw std::invalid_argument("vertex " + std::to_string(i) + " has the coordinate " +
                                    std::to_string(vertices[i][k]) + "; expected a finite number up to 1e60 m");
}

}  // namespace

PiecePtr make_hull_piece(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, double radius,
                         std::uint64_t loaded_vertices) {
  check_vertices(vertices);
  Digest digest;
  digest.add(vertices);
  digest.add(radius);

  UniquePositions<double> unique = unique_positions<double>(vertices);
  std::vector<Triangle> faces(triangles.begin(), triangles.end());
  for (Triangle& t : faces)
    for (std::uint32_t& i : t) i = unique.index[i];
  Adjacency adjacency = adjacency_of(faces, unique.positions.size());
  return make_piece(std::move(unique.positions), radius, std::max<std::uint64_t>(loaded_vertices, vertices.size()), std::move(adjacency.begin),
                    std::move(adjacency.neighbours), digest.value());
}

}  // namespace clearance
