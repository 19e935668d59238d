#include "engine/surface/surface_rows.h"

#include <numeric>

#include "engine/base/dedupe.h"

namespace clearance {

namespace {

// New numbers for vertices, from 0 on: as a walk from triangle to triangle meets them.
class Walk {
 public:
  explicit Walk(std::span<const std::uint32_t> corners, std::size_t vertices)
      : corners_(corners), first_(vertices + 1, 0), of_vertex_(corners.size()), number_(vertices, kNew) {
    for (const std::uint32_t v : corners) ++first_[v + 1];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t c = 0; c < corners.size(); ++c) of_vertex_[next[corners[c]]++] = c / 3;
    order_.reserve(vertices);
    for (std::size_t c = 0, done = 0; c < corners.size(); ++c) {
      meet(corners[c]);
      for (; done < order_.size(); ++done) go_on_from(order_[done]);
    }
  }
  std::uint32_t number(std::uint32_t vertex) const { return number_[vertex]; }
  /// The vertices in the order of their numbers, those that no triangle names left out.
  const std::vector<std::uint32_t>& order() const { return order_; }

 private:
  static constexpr std::uint32_t kNew = 0xFFFFFFFFu;

  void meet(std::uint32_t vertex) {
    if (number_[vertex] != kNew) return;
    number_[vertex] = static_cast<std::uint32_t>(order_.size());
    order_.push_back(vertex);
  }
  void go_on_from(std::uint32_t vertex) {
    for (std::size_t i = first_[vertex]; i < first_[vertex + 1]; ++i)
      for (std::size_t k = 0; k < 3; ++k) meet(corners_[3 * of_vertex_[i] + k]);
  }

  std::span<const std::uint32_t> corners_;
  std::vector<std::size_t> first_, of_vertex_;  // the triangles of vertex v: from first_[v] until before first_[v + 1]
  std::vector<std::uint32_t> number_, order_;
};

SurfaceRows rows_of_cloud(const Surface& surface) {
  SurfaceRows rows;
  for (std::uint32_t i = 0; i < surface.size(); ++i) {
    const ElementCorners element = surface.element(i);
    rows.corners_each = element.count;
    for (const Vec3d& v : element.span()) rows.vertices.push_back(v);
  }
  rows.corners.resize(rows.vertices.size());
  std::iota(rows.corners.begin(), rows.corners.end(), 0);
  rows.loaded = surface.size();
  return rows;
}

}  // namespace

SurfaceRows surface_rows(const Surface& surface) {
  if (surface.is_cloud()) return rows_of_cloud(surface);
  const UniquePositions<double> unique = unique_positions(surface.vertices());
  std::vector<std::uint32_t> corners;
  corners.reserve(3 * surface.triangles().size());
  for (const Triangle& t : surface.triangles())
    for (const std::uint32_t corner : t) corners.push_back(unique.index[corner]);
  const Walk walk(corners, unique.positions.size());
  SurfaceRows rows;
  rows.corners_each = 3;
  rows.loaded = surface.vertices().size();
  for (const std::uint32_t v : walk.order()) rows.vertices.push_back(unique.positions[v]);
  for (const std::uint32_t v : corners) rows.corners.push_back(walk.number(v));
  return rows;
}

}  // namespace clearance
