#include "engine/cover/mesh/mesh_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "engine/base/fp_environment.h"

namespace clearance {

namespace {

/// Cells are grown by this share of the reach before they cut triangles, so that no rounding puts a point of the body
/// into the wrong cell only.
constexpr double kOverlap = 0x1p-40;
/// Cells are not divided below these shares of the size: of an edge, and of the stand-out of its hull.
constexpr double kLeastEdge = 0x1p-9, kLeastStandOut = 0x1p-9;
/// Polygons and points that the estimate of a stand-out uses.
constexpr std::size_t kMostSampled = 48, kMostSampledPoints = 192;

/// A box and the parts of triangles in it: convex polygons.
struct Cell {
  Vec3d low, high;
  std::vector<Vec3d> points;
  std::vector<std::uint32_t> ends;  // of each polygon's points
  std::array<bool, 8> is_inside{};  // corners in the solid; bit k of the index is the side along axis k
  double stand_out = 0;             // estimate for the hull

  std::size_t polygons() const { return ends.size(); }
  std::span<const Vec3d> polygon(std::size_t i) const {
    const std::uint32_t begin = i == 0 ? 0 : ends[i - 1];
    return std::span(points).subspan(begin, ends[i] - begin);
  }
  Vec3d corner(std::size_t i) const { return {i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z}; }
  int longest_axis() const {
    const Vec3d size = high - low;
    return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  }
};

/// Adds the part of a polygon that is not above a plane across an axis; `way` -1 turns the axis.
void add_below(std::span<const Vec3d> polygon, int axis, double way, double at, Cell& to) {
  const std::size_t before = to.points.size();
  for (std::size_t i = 0; i < polygon.size(); ++i) {  // I. Sutherland, G. Hodgman (1974)
    const Vec3d &a = polygon[i], &b = polygon[i + 1 == polygon.size() ? 0 : i + 1];
    const bool is_a = way * a[axis] <= at, is_b = way * b[axis] <= at;
    if (is_a) to.points.push_back(a);
    if (is_a == is_b) continue;
    const double t = std::clamp((way * at - a[axis]) / (b[axis] - a[axis]), 0.0, 1.0);
    to.points.push_back(a * (1 - t) + b * t);
  }
  if (to.points.size() > before) to.ends.push_back(static_cast<std::uint32_t>(to.points.size()));
}

class CellDivider {
 public:
  explicit CellDivider(const Surface& surface) : surface_(surface) {
    Cell root;
    const double infinite = std::numeric_limits<double>::infinity();
    root.low = {infinite, infinite, infinite}, root.high = -root.low;
    double reach = 0;
    for (std::uint32_t e = 0; e < surface.size(); ++e) {
      const ElementCorners element = surface.element(e);
      for (const Vec3d& v : element.span()) {
        root.points.push_back(v);
        for (int k = 0; k < 3; ++k)
          root.low[k] = std::min(root.low[k], v[k]), root.high[k] = std::max(root.high[k], v[k]);
        reach = std::max(reach, norm(v));
      }
      root.ends.push_back(static_cast<std::uint32_t>(root.points.size()));
    }
    size_ = norm(root.high - root.low);
    growth_ = kOverlap * reach * (1 + 0x1p-40);
    for (int k = 0; k < 3; ++k) root.low[k] -= growth_, root.high[k] += growth_;
    for (std::size_t i = 0; i < 8; ++i) root.is_inside[i] = is_inside(root.corner(i));
    take(std::move(root));
  }

  void divide(std::size_t most) {
    while (!open_.empty() && open_.size() + done_.size() < most) {
      std::pop_heap(open_.begin(), open_.end(), is_less);
      const Cell cell = std::move(open_.back());
      open_.pop_back();
      halve(cell);
    }
  }

  MeshCells result() {
    MeshCells result;
    result.growth = growth_;
    for (std::vector<Cell>* cells : {&done_, &open_})
      for (const Cell& cell : *cells) result.points.push_back(hull_points(cell));
    return result;
  }

 private:
  static bool is_less(const Cell& a, const Cell& b) { return a.stand_out < b.stand_out; }
  bool is_inside(const Vec3d& p) const { return surface_.is_solid() && winding_number(surface_, p) != 0; }

  void halve(const Cell& cell) {
    const int axis = cell.longest_axis();
    const double middle = 0.5 * (cell.low[axis] + cell.high[axis]);
    Cell below, above;
    below.low = above.low = cell.low, below.high = above.high = cell.high;
    below.high[axis] = above.low[axis] = middle;
    for (std::size_t i = 0; i < cell.polygons(); ++i) {
      add_below(cell.polygon(i), axis, 1, middle + growth_, below);
      add_below(cell.polygon(i), axis, -1, growth_ - middle, above);
    }
    const std::size_t side = std::size_t{1} << axis;
    for (std::size_t i = 0; i < 8; ++i) {
      if (i & side) continue;
      below.is_inside[i] = cell.is_inside[i];
      above.is_inside[i | side] = cell.is_inside[i | side];
      below.is_inside[i | side] = above.is_inside[i] = is_inside(above.corner(i));
    }
    take(std::move(below));
    take(std::move(above));
  }

  void take(Cell&& cell) {
    const bool is_empty = std::none_of(cell.is_inside.begin(), cell.is_inside.end(), [](bool in) { return in; });
    if (cell.polygons() == 0 && is_empty) return;
    const int axis = cell.longest_axis();
    const bool is_small = !(cell.high[axis] - cell.low[axis] > kLeastEdge * size_);
    cell.stand_out = cell.polygons() == 0 || is_small ? 0 : stand_out(cell);
    if (!(cell.stand_out > kLeastStandOut * size_)) return done_.push_back(std::move(cell));
    open_.push_back(std::move(cell));
    std::push_heap(open_.begin(), open_.end(), is_less);
  }

  /// The body's part in a cell lies in the hull of the polygons and of the corners in the solid.
  static std::vector<Vec3d> hull_points(const Cell& cell) {
    std::vector<Vec3d> points = cell.points;
    for (std::size_t i = 0; i < 8; ++i)
      if (cell.is_inside[i]) points.push_back(cell.corner(i));
    const auto key = [](const Vec3d& v) { return std::array{v.x, v.y, v.z}; };
    std::sort(points.begin(), points.end(), [&](const Vec3d& a, const Vec3d& b) { return key(a) < key(b); });
    points.erase(
        std::unique(points.begin(), points.end(), [&](const Vec3d& a, const Vec3d& b) { return key(a) == key(b); }),
        points.end());
    return points;
  }

  /// How far the hull's points are on the wrong side of polygons: in front of them, or on both sides for a surface.
  double stand_out(const Cell& cell) const {
    const std::vector<Vec3d> points = hull_points(cell);
    double most = 0;
    for (std::size_t i = 0; i < cell.polygons(); i += 1 + cell.polygons() / kMostSampled) {
      const std::span<const Vec3d> polygon = cell.polygon(i);
      if (polygon.size() < 3) {
        most = std::max(most, 0.25 * norm(cell.high - cell.low));
        continue;
      }
      Vec3d n{0, 0, 0};
      for (std::size_t k = 2; k < polygon.size(); ++k) n += cross(polygon[k - 1] - polygon[0], polygon[k] - polygon[0]);
      const double length = norm(n);
      if (!(length > 0)) continue;
      double before = 0, behind = 0;
      for (std::size_t k = 0; k < points.size(); k += 1 + points.size() / kMostSampledPoints) {
        const double height = dot(n, points[k] - polygon[0]) / length;
        before = std::max(before, height);
        behind = std::max(behind, -height);
      }
      most = std::max(most, surface_.is_solid() ? std::min(before, behind) : std::max(before, behind));
    }
    return most;
  }

  const Surface& surface_;
  double size_ = 0, growth_ = 0;
  std::vector<Cell> open_, done_;  // a heap by stand-out; those that are not divided
};

}  // namespace

MeshCells mesh_cells(const Surface& surface, std::size_t most) {
  const FpEnvironment environment;
  CellDivider divider(surface);
  divider.divide(most);
  return divider.result();
}

}  // namespace clearance
