// Adjacency of a mesh's vertices, row by row, with tests whether the mesh is closed and convex.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// Directed edges of triangles, by their first vertex. No triangle may have the same vertex twice.
class MeshRows {
 public:
  MeshRows(std::size_t vertex_count, std::span<const Triangle> triangles);

  /// Whether the triangles form one closed surface of the topology of a sphere that uses every vertex and is nowhere
  /// concave by more than 1e-6 of its size: the rounding of positions to float32 makes edges slightly concave.
  bool is_convex(std::span<const Vec3d> vertices) const;
  /// The same without a tolerance, by exact tests; false if a triangle is so thin that its plane is unknown. Does not
  /// detect a surface that winds around itself more than once.
  bool is_exactly_convex(std::span<const Vec3d> vertices) const;
  /// Whether the triangles form one closed surface of the topology of a sphere that uses every vertex.
  bool is_sphere() const;

 private:
  struct Edge {
    std::uint32_t to;
    std::uint32_t opposite;  // third corner of the triangle
  };
  std::span<const Edge> row(std::uint32_t v) const {
    return {edges_.data() + begin_[v], edges_.data() + begin_[v + 1]};
  }
  template <class Good>
  bool is_good_at(std::uint32_t a, const Good& good) const;
  template <class Good>
  bool is_good_sphere(const Good& good) const;

  std::vector<std::uint64_t> begin_;
  std::vector<Edge> edges_;
  std::size_t triangle_count_;
};

}  // namespace clearance
