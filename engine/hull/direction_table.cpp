#include "engine/hull/direction_table.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "engine/base/fp_environment.h"
#include "engine/hull/cell_division.h"

namespace clearance {

namespace {

constexpr int kBelowGrid = 6;  // maximum divisions of a cell of the grid
constexpr double kMargin = 128 * 0x1p-53;

// A square of the unfolded map: 2^level cells along each axis.
struct Cell {
  std::uint32_t u, v;
  std::vector<std::uint32_t> list;  // vertices that may be farthest somewhere in it, ascending
  std::uint32_t word = 0;           // below the grid: index of its word
  bool final = false;
};

struct DivisionLimits {
  double margin;  // of divide_list()
  std::size_t few;
  int deepest;
};

// The children of all cells of a level.
std::vector<Cell> divided(const std::vector<Cell>& cells, std::span<const Vec3d> vertices, int level,
                          const DivisionLimits& limits) {
  std::vector<Cell> children(4 * cells.size());
#pragma omp parallel for schedule(dynamic, 16) if (cells.size() > 1 && vertices.size() > 1000)
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const FpEnvironment environment;
    const Cell& cell = cells[k];
    std::vector<std::uint32_t> lists[4];
    divide_list(vertices, cell.list, {cell.u, cell.v, level}, limits.margin, lists);
    std::size_t sum = 0;
    for (const auto& list : lists) sum += list.size();
    // Division ends if it hardly shortens the lists (coplanar vertices, or all vertices alike from far away).
    const bool in_vain = level > 3 && 4 * sum > 14 * cell.list.size();
    for (std::uint32_t q = 0; q < 4; ++q) {
      const bool final = lists[q].size() <= limits.few || level + 1 >= limits.deepest || in_vain;
      children[4 * k + q] = {2 * cell.u + (q & 1), 2 * cell.v + (q >> 1), std::move(lists[q]), cell.word + q, final};
    }
  }
  return children;
}

// Writes a final cell's list, and its position into all words that the cell covers.
// \param above number of levels above the grid's; negative if it has a word of its own
void put_list(DirectionTable& table, const Cell& cell, int above) {
  const auto at = static_cast<std::uint32_t>(table.lists.size());
  table.lists.push_back(static_cast<std::uint32_t>(cell.list.size()));
  table.lists.insert(table.lists.end(), cell.list.begin(), cell.list.end());
  if (above < 0) {
    table.cells[cell.word] = at;
    return;
  }
  const std::size_t grid = std::size_t{1} << table.grid_bits;
  for (std::size_t v = std::size_t{cell.v} << above; v < std::size_t{cell.v + 1} << above; ++v)
    for (std::size_t u = std::size_t{cell.u} << above; u < std::size_t{cell.u + 1} << above; ++u)
      table.cells[v * grid + u] = at;
}

}  // namespace

DirectionTable make_direction_table(std::span<const Vec3d> vertices, double rho, const TableStyle& style) {
  DirectionTable table;
  const double margin = kMargin * rho + style.blur;
  const std::size_t few = style.few;
  while (table.grid_bits < 10 && (std::size_t{1} << (2 * table.grid_bits)) < vertices.size()) ++table.grid_bits;
  const int grid_level = std::max<int>(static_cast<int>(table.grid_bits + style.finer), 1);
  table.grid_bits = static_cast<std::uint32_t>(grid_level);
  const std::size_t grid = std::size_t{1} << grid_level;
  const int deepest = std::min(grid_level + kBelowGrid, DirectionTable::kDeepest);
  table.cells.assign(grid * grid, 0);

  // Level by level, from the whole square: its four quadrants each hold an upper and a lower face of the octahedron.
  std::vector<Cell> cells(1);
  cells[0] = {0, 0, std::vector<std::uint32_t>(vertices.size()), 0, false};
  std::iota(cells[0].list.begin(), cells[0].list.end(), 0u);
  for (int level = 0; !cells.empty(); ++level) {
    std::vector<Cell> children = divided(cells, vertices, level, {margin, few, deepest});
    cells.clear();
    for (Cell& cell : children) {
      if (cell.final) {
        put_list(table, cell, grid_level - (level + 1));
        continue;
      }
      if (level + 1 >= grid_level) {
        const auto four = static_cast<std::uint32_t>(table.cells.size());
        table.cells[level + 1 == grid_level ? cell.v * grid + cell.u : cell.word] = DirectionTable::kDivided | four;
        table.cells.resize(table.cells.size() + 4);
        cell.word = four;
      }
      cells.push_back(std::move(cell));
    }
  }
  table.cells.shrink_to_fit();
  table.lists.shrink_to_fit();
  return table;
}

bool is_sound(const DirectionTable& table, std::size_t vertices) {
  if (table.grid_bits < 1 || table.grid_bits > DirectionTable::kDeepest) return false;
  const std::size_t grid = std::size_t{1} << (2 * table.grid_bits);
  if (table.cells.size() < grid) return false;
  std::vector<std::uint8_t> depth(table.cells.size(), 0);
  for (std::size_t i = 0; i < table.cells.size(); ++i) {
    const std::uint32_t word = table.cells[i];
    if (word & DirectionTable::kDivided) {
      const std::size_t first = word & ~DirectionTable::kDivided;
      if (first <= i || first < grid || first + 4 > table.cells.size()) return false;
      if (table.grid_bits + depth[i] >= DirectionTable::kDeepest) return false;
      for (std::size_t k = 0; k < 4; ++k) depth[first + k] = static_cast<std::uint8_t>(depth[i] + 1);
    } else if (word >= table.lists.size()) {
      return false;
    }
  }
  for (std::size_t i = 0; i < table.lists.size();) {
    const std::size_t count = table.lists[i];
    if (count == 0 || count > table.lists.size() - i - 1) return false;
    for (std::size_t k = 1; k <= count; ++k)
      if (table.lists[i + k] >= vertices) return false;
    i += count + 1;
  }
  // Cells must point to the beginning of a list.
  std::vector<bool> begins(table.lists.size(), false);
  for (std::size_t i = 0; i < table.lists.size(); i += table.lists[i] + 1) begins[i] = true;
  return std::all_of(table.cells.begin(), table.cells.end(),
                     [&](std::uint32_t word) { return (word & DirectionTable::kDivided) || begins[word]; });
}

}  // namespace clearance
