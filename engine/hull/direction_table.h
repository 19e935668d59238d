// Support of large hulls: for every direction the few vertices that can be farthest along it.
//
// Directions are cells of an octahedral map (the sphere of directions projected onto |x| + |y| + |z| = 1 and unfolded
// into a square; T. Engelhardt, C. Dachsbacher, "Octahedron environment maps", VMV 2008). Within a cell a direction is
// a combination of the cell's corner directions with weights >= 0, since every fold of the map runs along cell borders
// or diagonals. A vertex that another vertex beats at all four corners, by more than any rounding, can therefore be
// farthest along no direction of the cell, and is left out of its list. So the table is exact for any faces and edges
// of the hull.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/lane.h"
#include "engine/base/vec.h"

namespace clearance {

struct DirectionTable {
  /// (grid_cells^2,) first, then groups of four cells that a crowded cell is divided into (low u, low v first; then
  /// high u). A cell's word is kDivided | index of the first of its four, or the position of its list in `lists`.
  std::vector<std::uint32_t> cells;
  /// Lists one after another: number of vertices, then their indices, ascending.
  std::vector<std::uint32_t> lists;
  std::uint32_t grid_bits = 0;  ///< log2 of the cells along each axis of the grid

  static constexpr std::uint32_t kDivided = 1u << 31;
  static constexpr int kDeepest = 16;  ///< log2 of the finest cells along an axis

  /// Vertices that include the farthest along n (any finite length except 0). All vertices within 32 u |n| rho of the
  /// farthest are among them, u = 2^-53.
  std::span<const std::uint32_t> candidates(const Vec3d& n) const;
  std::size_t bytes() const { return (cells.capacity() + lists.capacity()) * sizeof(std::uint32_t); }
};

/// Tuning parameters of a table.
struct TableStyle {
  std::size_t few = 6;      ///< vertices of a list that is not worth dividing further
  std::uint32_t finer = 0;  ///< added to grid_bits
  /// Lists also hold vertices that one farther by this may hide, in metres per length of the direction: for directions
  /// that are looked up with an error.
  double blur = 0;
};

/// Whether every path through the cells ends at a list of valid vertices. Does not test the lists themselves.
bool is_sound(const DirectionTable& table, std::size_t vertices);

/// \param rho max |v| over the vertices, of which there is at least one
DirectionTable make_direction_table(std::span<const Vec3d> vertices, double rho, const TableStyle& style);
inline DirectionTable make_direction_table(std::span<const Vec3d> vertices, double rho, std::size_t few = 6) {
  return make_direction_table(vertices, rho, TableStyle{.few = few});
}

/// The blur that lets float32 find a direction's list, for directions of lengths from 10^-30 to 10^30: see
/// docs/trust/bounds.md.
/// \param spread bound on the vertices' distance from a point among them, metres
constexpr double float_blur(double spread) {
  return 64 * 0x1p-24 * spread;
}

/// Position of a direction in the unfolded square, in units of the finest cells. A scalar or a pack.
template <class T>
struct MapPoint {
  T u, v;
};
template <class T>
CLEARANCE_INLINE MapPoint<T> map_point(const Vec3<T>& n) {
  const T zero(0), half(1 << (DirectionTable::kDeepest - 1)), last((1 << DirectionTable::kDeepest) - 1);
  const auto low_x = n.x < zero, low_y = n.y < zero, low_z = n.z < zero;
  const T ax = select(low_x, -n.x, n.x), ay = select(low_y, -n.y, n.y), az = select(low_z, -n.z, n.z);
  const T scale = half / (ax + ay + az);
  T u = ax * scale, v = ay * scale;
  const T folded_u = half - v, folded_v = half - u;
  u = select(low_z, folded_u, u);
  v = select(low_z, folded_v, v);
  u = select(low_x, half - u, half + u);
  v = select(low_y, half - v, half + v);
  // also for directions of length 0 or with an infinity
  u = select(u > zero, select(u < last, u, last), zero);
  v = select(v > zero, select(v < last, v, last), zero);
  return {u, v};
}

/// The finest cell that holds a direction, by float32: map_point() without the handling of directions of length 0. A
/// device's fast division suffices, since the margin of blurred tables covers it.
struct CellPoint {
  std::uint32_t u, v;
};
/// \param inverse 1 / (|x| + |y| + |z|), to within 2^-23 of it
CLEARANCE_HD inline CellPoint cell_point(const Vec3<float>& n, float inverse) {
  using std::abs;
  constexpr float half = 1 << (DirectionTable::kDeepest - 1);
  constexpr std::int32_t last = (1 << DirectionTable::kDeepest) - 1;
  const float scale = half * inverse;
  float u = abs(n.x) * scale, v = abs(n.y) * scale;
  const float folded_u = half - v, folded_v = half - u;
  u = n.z < 0 ? folded_u : u;
  v = n.z < 0 ? folded_v : v;
  u = half + (n.x < 0 ? -u : u);
  v = half + (n.y < 0 ? -v : v);
  // None is lower than a hundredth below zero, and that is cut off.
  const auto i = static_cast<std::int32_t>(u), j = static_cast<std::int32_t>(v);
  return {static_cast<std::uint32_t>(i < last ? i : last), static_cast<std::uint32_t>(j < last ? j : last)};
}

/// Position of the list for that point.
/// \param cells words of any width, as cells[i]; the highest bit is DirectionTable::kDivided
/// \param map_u,map_v scalars
template <class Cells, class T>
CLEARANCE_INLINE std::uint32_t find_list(const Cells& cells, std::uint32_t grid_bits, const T& map_u, const T& map_v) {
  const auto u = static_cast<std::uint32_t>(static_cast<std::int32_t>(map_u)),
             v = static_cast<std::uint32_t>(static_cast<std::int32_t>(map_v));
  std::uint32_t shift = DirectionTable::kDeepest - grid_bits;
  constexpr std::uint32_t divided = std::uint32_t{1} << (8 * sizeof(cells[0]) - 1);
  std::uint32_t word = cells[(v >> shift) << grid_bits | u >> shift];
  while (word & divided) {
    --shift;
    word = cells[(word & ~divided) + ((v >> shift & 1) << 1 | (u >> shift & 1))];
  }
  return word;
}

inline std::span<const std::uint32_t> DirectionTable::candidates(const Vec3d& n) const {
  const MapPoint<double> at = map_point(n);
  const std::uint32_t* list = lists.data() + find_list(cells.data(), grid_bits, at.u, at.v);
  return {list + 1, list[0]};
}

}  // namespace clearance
