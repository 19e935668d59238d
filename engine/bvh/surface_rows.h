// A surface as lists for whoever is to check it: vertices, each once, and elements that name them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/dedupe.h"
#include "engine/bvh/surface.h"

namespace clearance {

struct SurfaceRows {
  /// Metres, body frame. Of triangles no two are equal, and each but the first of those that hang together shares a
  /// triangle with an earlier one. Those of other elements stand by themselves.
  std::vector<Vec3d> vertices;
  /// Places of corners, those of one element after those of another, in the order of Surface::element().
  std::vector<std::uint32_t> corners;
  std::size_t corners_each = 0;
  std::size_t loaded = 0;  ///< vertices, before they were made to be there once

  std::span<const std::uint32_t> element(std::size_t i) const {
    return std::span(corners).subspan(i * corners_each, corners_each);
  }
};

/// Lists a surface a little at a time: a large one takes tenths of a second.
class SurfaceLister {
 public:
  /// \param surface must outlive this
  explicit SurfaceLister(const Surface& surface);

  /// Takes so many steps, of some nanoseconds each. Returns true once rows() are there.
  bool advance(std::size_t steps);
  const SurfaceRows& rows() const { return rows_; }

 private:
  static constexpr std::uint32_t kNew = 0xFFFFFFFFu;
  enum class Part { kCloud, kNumbers, kCorners, kStarts, kTriangles, kWalk, kRename, kOver };

  bool step();
  bool goes_on(std::size_t count, Part next);
  bool walk();
  void meet(std::uint32_t number);
  void list_element(std::uint32_t element);

  const Surface& surface_;
  SurfaceRows rows_;
  Part part_;
  std::size_t at_ = 0;  // of what the part goes through
  // Of triangles: vertices get a number by their positions, and another one as a walk from triangle to triangle meets
  // them.
  PositionIndex<double> positions_;
  std::vector<std::uint32_t> number_;            // by vertex
  std::vector<std::uint32_t> begin_, triangle_;  // the triangles of number n: from begin_[n] until before begin_[n + 1]
  std::vector<std::uint32_t> order_, met_;       // numbers as they are met, and the place of each among them
  std::size_t done_ = 0;                         // of order_: whose triangles were gone through
  std::uint32_t next_ = 0;                       // of triangle_: of the one whose turn it is
};

}  // namespace clearance
