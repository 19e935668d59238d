#include "engine/decision/joint_table.h"

#include <algorithm>

namespace clearance {

std::uint32_t JointTable::levels() const {
  return std::max(columns[0].shift, columns[1].shift) + 1;
}

std::size_t JointTable::level_begin(std::uint32_t level) const {
  const TableCells table = view();
  std::size_t begin = 0;
  for (std::uint32_t l = 0; l < level; ++l) begin += std::size_t{1} << (table.shift(0, l) + table.shift(1, l));
  return begin;
}

void JointTable::join_cells() {
  cells.resize(level_begin(levels()));
  const TableCells table = view();
  for (std::uint32_t level = 1; level < levels(); ++level) {
    const std::size_t from = level_begin(level - 1), to = level_begin(level);
    const std::uint32_t width = table.shift(1, level), fine_width = table.shift(1, level - 1);
    const std::size_t fine_rows = std::size_t{1} << table.shift(0, level - 1);
    // A column of one cell stays as it is.
    const std::uint32_t halves = fine_rows > 1 ? 1 : 0, halves_in_row = fine_width - width;
    std::fill_n(cells.begin() + static_cast<std::ptrdiff_t>(to), level_begin(level + 1) - to,
                TableCell{TableCell::kNoHigh, TableCell::kNoLow});
    for (std::size_t i = 0; i < fine_rows; ++i)
      for (std::size_t j = 0; j < std::size_t{1} << fine_width; ++j) {
        const TableCell cell = cells[from + (i << fine_width) + j];
        TableCell& joined = cells[to + ((i >> halves) << width) + (j >> halves_in_row)];
        joined = {std::min(joined.low, cell.low), std::max(joined.high, cell.high)};
      }
  }
}

}  // namespace clearance
