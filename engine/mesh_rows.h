// Which vertices a mesh joins, row by row, and whether it is closed and convex.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "math.h"
#include "shapes.h"

namespace clearance {

/// Edges of triangles, by the vertex that they start from. No triangle may name a vertex twice.
class MeshRows {
 public:
  enum class Ways {
    kOwn,  ///< each edge as its triangle runs along it: all there is to a closed surface, whose edges are run along
           ///< both ways
    kBoth,
  };
  /// \param extra_edges further edges, both ways, of no triangle.
  MeshRows(std::size_t vertex_count, std::span<const Triangle> triangles, Ways ways,
           std::span<const std::array<std::uint32_t, 2>> extra_edges = {});

  /// Distinct neighbours of each vertex, ascending, in compressed rows; both empty if some vertex has none.
  void neighbours(std::vector<std::uint32_t>* begin, std::vector<std::uint32_t>* out) const;

  /// Whether the triangles form one closed surface of the topology of a sphere that uses every vertex and is nowhere
  /// concave by more than 1e-6 of its size: the rounding of positions to float32 makes edges slightly concave.
  /// Of rows made with Ways::kOwn only.
  bool is_convex(std::span<const Vec3d> vertices) const;

 private:
  struct Edge {
    std::uint32_t to;
    std::uint32_t opposite;  // third corner of the triangle
  };
  std::span<const Edge> row(std::uint32_t v) const {
    return {edges_.data() + begin_[v], edges_.data() + begin_[v + 1]};
  }
  bool is_convex_at(std::uint32_t a, std::span<const Vec3d> vertices, double tolerance) const;

  std::vector<std::uint64_t> begin_;
  std::vector<Edge> edges_;
  std::size_t triangle_count_;
};

}  // namespace clearance
