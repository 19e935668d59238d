#include "engine/decision/joint_table.h"

#include <algorithm>

namespace clearance {

namespace {

TableCell join(TableCell a, TableCell b) {
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

}  // namespace

TableCell JointTable::at(const std::array<double, 2>& positions) const {
  std::uint32_t i = 0, j = 0;
  if (!cell_of(columns[0], positions[0], i) || !cell_of(columns[1], positions[1], j)) return TableCell::none();
  return cells[(std::size_t{i} << columns[1].shift) + j];
}

TableCell JointTable::over(const std::array<double, 2>& low, const std::array<double, 2>& high) const {
  constexpr std::uint32_t kMostCells = 4;  // in each column
  std::uint32_t first[2], last[2], level = 0;
  for (int c = 0; c < 2; ++c) {
    const TableColumn& column = columns[c];
    if (!(low[c] <= high[c]) || !cell_of(column, low[c], first[c]) || !cell_of(column, high[c], last[c]))
      return TableCell::none();
    if (column.turns_per_cell > 0) {
      if ((high[c] - low[c]) * column.cells_per_unit + 2 >= column.count())
        first[c] = 0, last[c] = column.count() - 1;
      else if (last[c] < first[c])
        last[c] += column.count();
    }
    while ((last[c] >> level) - (first[c] >> level) >= kMostCells) ++level;
  }
  const std::size_t begin = level_begin(level);
  const std::uint32_t shift[2] = {level_shift(0, level), level_shift(1, level)};
  // A column with few cells has one cell in the coarser levels.
  const auto at_level = [&](int c, std::uint32_t cell) { return cell >> (columns[c].shift - shift[c]); };
  TableCell result{TableCell::kNoHigh, TableCell::kNoLow};
  for (std::uint32_t i = at_level(0, first[0]); i <= at_level(0, last[0]); ++i)
    for (std::uint32_t j = at_level(1, first[1]); j <= at_level(1, last[1]); ++j) {
      const std::size_t row = i & ((1u << shift[0]) - 1), in_row = j & ((1u << shift[1]) - 1);
      result = join(result, cells[begin + (row << shift[1]) + in_row]);
    }
  return result;
}

std::uint32_t JointTable::levels() const {
  return std::max(columns[0].shift, columns[1].shift) + 1;
}

std::size_t JointTable::level_begin(std::uint32_t level) const {
  std::size_t begin = 0;
  for (std::uint32_t l = 0; l < level; ++l) begin += std::size_t{1} << (level_shift(0, l) + level_shift(1, l));
  return begin;
}

void JointTable::join_cells() {
  cells.resize(level_begin(levels()));
  for (std::uint32_t level = 1; level < levels(); ++level) {
    const std::size_t from = level_begin(level - 1), to = level_begin(level);
    const std::uint32_t rows = level_shift(0, level), width = level_shift(1, level),
                        fine_width = level_shift(1, level - 1);
    const bool has_rows = level_shift(0, level - 1) > rows, has_columns = fine_width > width;
    for (std::size_t i = 0; i < std::size_t{1} << rows; ++i)
      for (std::size_t j = 0; j < std::size_t{1} << width; ++j) {
        const std::size_t at = from + ((has_rows ? 2 * i : i) << fine_width) + (has_columns ? 2 * j : j);
        TableCell cell = cells[at];
        if (has_columns) cell = join(cell, cells[at + 1]);
        if (has_rows) cell = join(cell, cells[at + (std::size_t{1} << fine_width)]);
        if (has_rows && has_columns) cell = join(cell, cells[at + (std::size_t{1} << fine_width) + 1]);
        cells[to + (i << width) + j] = cell;
      }
  }
}

}  // namespace clearance
