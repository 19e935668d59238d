// Bounds on the distance of two links of one robot, by the positions of the one or two joints between them
// (docs/trust/bounds_covers.md, Joint tables).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clearance {

/// A column of a robot's positions, divided into cells of the same width.
struct TableColumn {
  std::uint32_t column = 0;    ///< of the robot
  std::uint32_t shift = 0;     ///< there are 2^shift cells
  double least = 0, most = 0;  ///< range of positions in the table; radians or metres
  double begin = 0;            ///< position at which the first cell begins
  double cells_per_unit = 0;   ///< cells per radian or metre
  double turns_per_cell = 0;   ///< of a joint that turns without end; otherwise 0

  std::uint32_t count() const { return std::uint32_t{1} << shift; }
};

/// Bounds on the signed distance of the links' convex parts, in multiples of JointTable::kUnit. `low` is kNoLow and
/// `high` is kNoHigh without a bound.
struct TableCell {
  std::int16_t low, high;

  static constexpr std::int16_t kNoLow = -32768, kNoHigh = 32767;
};

// For functions below, which kernels of all instruction sets use.
#define CLEARANCE_TABLE_INLINE __attribute__((always_inline)) inline

/// Cells of a table as plain arrays (JointTable).
struct TableCells {
  const TableCell* cells;
  TableColumn columns[2];

  /// There are 2^shift cells of a column in a level.
  CLEARANCE_TABLE_INLINE std::uint32_t shift(int c, std::uint32_t level) const {
    return columns[c].shift > level ? columns[c].shift - level : 0;
  }
  /// The cell at positions of the columns, or null outside the table.
  CLEARANCE_TABLE_INLINE const TableCell* find(const double* positions) const {
    std::uint32_t i = 0, j = 0;
    if (!cell_of(columns[0], positions[0], i) || !cell_of(columns[1], positions[1], j)) return nullptr;
    return cells + (std::uint64_t{i} << columns[1].shift) + j;
  }
  /// Bounds at positions of the columns, or none outside the table.
  CLEARANCE_TABLE_INLINE TableCell at(const double* positions) const {
    const TableCell* const cell = find(positions);
    return cell ? *cell : TableCell{TableCell::kNoLow, TableCell::kNoHigh};
  }
  /// Bounds that hold for all positions between two ends, low <= high in each column.
  /// \param most cells of each column, in the level chosen: fewer take less time and make the bounds wider
  CLEARANCE_TABLE_INLINE TableCell over(const double* low, const double* high, std::uint32_t most = 4) const;

  /// Finds the cell of a position, and returns false outside the table. The maker enlarges cells by more than the
  /// rounding.
  CLEARANCE_TABLE_INLINE static bool cell_of(const TableColumn& c, double position, std::uint32_t& cell) {
    if (!(c.least <= position && position <= c.most)) return false;
    const std::uint32_t count = std::uint32_t{1} << c.shift;
    double x = (position - c.begin) * c.cells_per_unit;
    x -= static_cast<double>(count) * static_cast<double>(static_cast<std::int32_t>(x * c.turns_per_cell));
    if (x < 0) x = c.turns_per_cell > 0 ? x + static_cast<double>(count) : 0;
    const auto i = static_cast<std::uint32_t>(x);
    cell = i < count ? i : count - 1;
    return true;
  }
};

CLEARANCE_TABLE_INLINE TableCell TableCells::over(const double* low, const double* high, std::uint32_t most) const {
  constexpr TableCell kNoBounds{TableCell::kNoLow, TableCell::kNoHigh};
  std::uint32_t first[2], last[2], level = 0;
  for (int c = 0; c < 2; ++c) {
    const TableColumn& column = columns[c];
    if (!(low[c] <= high[c]) || !cell_of(column, low[c], first[c]) || !cell_of(column, high[c], last[c]))
      return kNoBounds;
    const std::uint32_t count = std::uint32_t{1} << column.shift;
    if (column.turns_per_cell > 0) {
      if ((high[c] - low[c]) * column.cells_per_unit + 2 >= static_cast<double>(count))
        first[c] = 0, last[c] = count - 1;
      else if (last[c] < first[c])
        last[c] += count;
    }
    while ((last[c] >> level) - (first[c] >> level) >= most) ++level;
  }
  std::uint64_t begin = 0;
  for (std::uint32_t l = 0; l < level; ++l) begin += std::uint64_t{1} << (shift(0, l) + shift(1, l));
  const std::uint32_t rows = shift(0, level), width = shift(1, level);
  const std::uint32_t by[2] = {columns[0].shift - rows, columns[1].shift - width};
  TableCell result{TableCell::kNoHigh, TableCell::kNoLow};
  for (std::uint32_t i = first[0] >> by[0]; i <= last[0] >> by[0]; ++i)
    for (std::uint32_t j = first[1] >> by[1]; j <= last[1] >> by[1]; ++j) {
      const std::uint64_t row = i & ((1u << rows) - 1), in_row = j & ((1u << width) - 1);
      const TableCell cell = cells[begin + (row << width) + in_row];
      result.low = cell.low < result.low ? cell.low : result.low;
      result.high = result.high < cell.high ? cell.high : result.high;
    }
  return result;
}

/// Immutable. Bounds hold for the joints in real arithmetic.
struct JointTable {
  static constexpr double kUnit = 0x1p-18;  ///< metres

  std::array<TableColumn, 2> columns{};  ///< the second one has one cell if there is one joint
  std::uint32_t column_count = 0;
  /// By (column 0, column 1), then coarser levels: each cell of one joins 2 x 2 of the level before.
  std::vector<TableCell> cells;

  TableCells view() const { return {cells.data(), {columns[0], columns[1]}}; }
  /// TableCells::at() and over().
  TableCell at(const std::array<double, 2>& positions) const { return view().at(positions.data()); }
  TableCell over(const std::array<double, 2>& low, const std::array<double, 2>& high) const {
    return view().over(low.data(), high.data());
  }

  /// Number of levels, and of cells before a level.
  std::uint32_t levels() const;
  std::size_t level_begin(std::uint32_t level) const;
  /// Computes the coarser levels from the first one.
  void join_cells();

  std::uint64_t resident_bytes() const { return sizeof *this + cells.capacity() * sizeof(TableCell); }
};

}  // namespace clearance
