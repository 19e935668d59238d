// Lists a mesh for an independent check: unique vertices, and elements with their indices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/dedupe.h"
#include "engine/bvh/surface.h"

namespace clearance {

struct SurfaceRows {
  /// Metres, body frame. Vertices of triangles are unique, and each but the first of a connected component shares a
  /// triangle with an earlier one. Those of other elements are not shared.
  std::vector<Vec3d> vertices;
  /// Vertex indices of the corners, element by element, in the order of Surface::element().
  std::vector<std::uint32_t> corners;
  std::size_t corners_each = 0;
  std::size_t loaded = 0;  ///< number of vertices before duplicates were merged

  std::span<const std::uint32_t> element(std::size_t i) const {
    return std::span(corners).subspan(i * corners_each, corners_each);
  }
};

/// Lists a mesh in small steps, since a large one takes tenths of a second.
class SurfaceLister {
 public:
  /// \param surface must outlive this
  explicit SurfaceLister(const Surface& surface);

  /// Takes this number of steps, of some nanoseconds each. Returns true once rows() is complete.
  bool advance(std::size_t steps);
  const SurfaceRows& rows() const { return rows_; }

 private:
  static constexpr std::uint32_t kNew = 0xFFFFFFFFu;
  enum class Part { kCloud, kNumbers, kCorners, kStarts, kTriangles, kWalk, kRename, kOver };

  bool step();
  bool goes_on(std::size_t count, Part next);
  bool walk();
  void add_vertex(std::uint32_t number);
  void list_element(std::uint32_t element);

  const Surface& surface_;
  SurfaceRows rows_;
  Part part_;
  std::size_t at_ = 0;  // position within the current step
  // For triangles: vertices are numbered by position, and again in the order in which a walk from triangle to triangle
  // meets them.
  PositionIndex<double> positions_;
  std::vector<std::uint32_t> number_;            // by vertex
  std::vector<std::uint32_t> begin_, triangle_;  // the triangles of number n: from begin_[n] until before begin_[n + 1]
  std::vector<std::uint32_t> order_, met_;       // numbers in the order of the walk, and the place of each in it
  std::size_t done_ = 0;                         // in order_: vertices whose triangles are done
  std::uint32_t next_ = 0;                       // in triangle_: next triangle of the current vertex
};

}  // namespace clearance
