// Bounds on the distance of two links of one robot, by the positions of the one or two joints between them
// (docs/bounds_covers.md, "Joint tables").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clearance {

/// A column of a robot's positions, divided into cells of the same width.
struct TableColumn {
  std::uint32_t column = 0;  ///< of the robot
  std::uint32_t shift = 0;   ///< there are 2^shift cells
  double least = 0, most = 0;       ///< positions that the table knows; radians or metres
  double begin = 0;                 ///< position at which the first cell begins
  double cells_per_unit = 0;        ///< cells per radian or metre
  double turns_per_cell = 0;        ///< of a joint that turns without end; otherwise 0

  __attribute__((always_inline)) std::uint32_t count() const { return std::uint32_t{1} << shift; }
};

/// Bounds on the signed distance of the links' convex parts, in multiples of JointTable::kUnit. `low` is kNoLow and
/// `high` is kNoHigh without a bound.
struct TableCell {
  std::int16_t low, high;

  static constexpr std::int16_t kNoLow = -32768, kNoHigh = 32767;
  static constexpr TableCell none() { return {kNoLow, kNoHigh}; }
};

/// Immutable. Bounds hold for the joints in real arithmetic.
struct JointTable {
  static constexpr double kUnit = 0x1p-18;  ///< metres

  std::array<TableColumn, 2> columns{};  ///< the second one has one cell if there is one joint
  std::uint32_t column_count = 0;
  /// By (column 0, column 1), then coarser levels: each cell of one joins 2 x 2 of the level before.
  std::vector<TableCell> cells;

  /// Bounds at positions of the columns, or none outside the table.
  TableCell at(const std::array<double, 2>& positions) const;
  /// Bounds that hold for all positions between two ends, low <= high in each column.
  TableCell over(const std::array<double, 2>& low, const std::array<double, 2>& high) const;

  std::uint32_t level_shift(int column, std::uint32_t level) const {
    return columns[column].shift > level ? columns[column].shift - level : 0;
  }
  /// Number of levels, and of cells before a level.
  std::uint32_t levels() const;
  std::size_t level_begin(std::uint32_t level) const;
  /// Computes the coarser levels from the first one.
  void join_cells();

  std::uint64_t resident_bytes() const { return sizeof *this + cells.capacity() * sizeof(TableCell); }
};

/// Finds the cell of a position, and returns false outside the table. The rounding is less than what the maker enlarges
/// cells by.
__attribute__((always_inline)) inline bool cell_of(const TableColumn& c, double position, std::uint32_t& cell) {
  if (!(c.least <= position && position <= c.most)) return false;
  const double count = static_cast<double>(c.count());
  double x = (position - c.begin) * c.cells_per_unit;
  x -= count * static_cast<double>(static_cast<std::int32_t>(x * c.turns_per_cell));
  if (x < 0) x = c.turns_per_cell > 0 ? x + count : 0;
  const auto i = static_cast<std::uint32_t>(x);
  cell = i < c.count() ? i : c.count() - 1;
  return true;
}

}  // namespace clearance
