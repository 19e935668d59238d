#include "direction_table.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "clones.h"
#include "fp_environment.h"

namespace clearance {

namespace {

constexpr std::size_t kCompareAll = 16;   // lists up to this length are compared each with each
constexpr int kBelowGrid = 6;             // how often a cell of the grid may be divided
constexpr double kMargin = 128 * 0x1p-53;

// The direction of a point of the square [-1, 1]^2, |x| + |y| + |z| = 1. Exact for the dyadic numbers that cells have.
Vec3d direction_at(double u, double v) {
  const double au = std::abs(u), av = std::abs(v), z = 1 - au - av;
  if (z >= 0) return {u, v, z};
  return {std::copysign(1 - av, u), std::copysign(1 - au, v), z};
}

// The 3 x 3 lattice of directions of a cell's four children: child (i, j) has the corners (i, j) to (i + 1, j + 1).
struct Lattice {
  Vec3d direction[9];
  double margin[9];   // that a difference of two computed values must exceed to be sure
};

Lattice lattice_of(std::uint32_t u, std::uint32_t v, int level, double margin) {
  Lattice l;
  const double half = 1.0 / static_cast<double>(1u << level);   // of a cell's edge
  for (int k = 0; k < 9; ++k) {
    l.direction[k] = direction_at(-1 + half * (2 * u + k % 3), -1 + half * (2 * v + k / 3));
    l.margin[k] = margin * norm(l.direction[k]);
  }
  return l;
}
constexpr int kCorner[4][4] = {{0, 1, 3, 4}, {1, 2, 4, 5}, {3, 4, 6, 7}, {4, 5, 7, 8}};   // of each child

constexpr std::size_t kLanes = 8;

// out[i] = direction . v_i.
CLEARANCE_CLONES void values_along(const double* x, const double* y, const double* z, std::size_t padded,
                                   const Vec3d& direction, double* out) {
  for (std::size_t i = 0; i < padded; i += kLanes)
    for (std::size_t k = 0; k < kLanes; ++k)
      out[i + k] = direction.x * x[i + k] + direction.y * y[i + k] + direction.z * z[i + k];
}

struct Farthest {
  double value = -1e300;
  std::size_t index = 0;
};
// Takes the largest of direction . v_i, begin <= i < end, into `so_far`.
CLEARANCE_CLONES void farthest_along(const double* x, const double* y, const double* z, std::size_t begin, std::size_t end,
                                     const Vec3d& direction, Farthest& so_far) {
  double best[kLanes], index[kLanes];
  for (std::size_t k = 0; k < kLanes; ++k) best[k] = -1e300, index[k] = 0;
  for (std::size_t i = begin; i < end; i += kLanes)
    for (std::size_t k = 0; k < kLanes; ++k) {
      const double s = direction.x * x[i + k] + direction.y * y[i + k] + direction.z * z[i + k];
      const bool better = s > best[k];
      best[k] = better ? s : best[k];
      index[k] = better ? static_cast<double>(i) : index[k];
    }
  for (std::size_t k = 0; k < kLanes; ++k)
    if (best[k] > so_far.value) so_far = {best[k], static_cast<std::size_t>(index[k]) + k};
}

// beaten[i] = 1 where one of five bars is above all four values.
CLEARANCE_CLONES void compare(const double* s0, const double* s1, const double* s2, const double* s3, std::size_t padded,
                              const double (&bar)[5][4], double* beaten) {
  for (std::size_t i = 0; i < padded; i += kLanes)
    for (std::size_t k = 0; k < kLanes; ++k) {
      double any = 0;
      for (int b = 0; b < 5; ++b) {
        const bool below = (s0[i + k] < bar[b][0]) & (s1[i + k] < bar[b][1]) & (s2[i + k] < bar[b][2]) & (s3[i + k] < bar[b][3]);
        any = below ? 1.0 : any;
      }
      beaten[i + k] = any;
    }
}

// Divides the list of a cell among its children: each leaves out the vertices that one other beats at all its corners.
class Divider {
 public:
  void set_few(std::size_t few) { few_ = few; }
  void operator()(std::span<const Vec3d> vertices, const std::vector<std::uint32_t>& from, const Lattice& lattice,
                  std::vector<std::uint32_t> (&children)[4]) {
    const std::size_t count = from.size(), padded = (count + kLanes - 1) / kLanes * kLanes;
    for (std::vector<double>* column : {&x_, &y_, &z_}) column->resize(padded);
    for (std::size_t i = 0; i < padded; ++i) {
      const Vec3d& v = vertices[from[i < count ? i : 0]];
      x_[i] = v.x, y_[i] = v.y, z_[i] = v.z;
    }
    // Challengers: what is farthest along each lattice direction, and along the middle of each child's corners.
    Vec3d middle[4];
    for (int child = 0; child < 4; ++child) {
      const int* c = kCorner[child];
      middle[child] = lattice.direction[c[0]] + lattice.direction[c[1]] + lattice.direction[c[2]] + lattice.direction[c[3]];
    }
    Farthest far[9], far_middle[4];
    // Any vertex may challenge: of a long list a part is looked through, since its cell is divided again anyway.
    const std::size_t stride = count > kSampleFrom ? 8 * kChunk : kChunk;
    for (std::size_t at = 0; at < padded; at += stride) {
      const std::size_t end = std::min(padded, at + kChunk);
      for (int k = 0; k < 9; ++k) farthest_along(x_.data(), y_.data(), z_.data(), at, end, lattice.direction[k], far[k]);
      for (int k = 0; k < 4; ++k) farthest_along(x_.data(), y_.data(), z_.data(), at, end, middle[k], far_middle[k]);
    }
    double bar[4][5][4];
    for (int child = 0; child < 4; ++child) {
      const int* c = kCorner[child];
      const std::size_t challenger[5] = {far[c[0]].index, far[c[1]].index, far[c[2]].index, far[c[3]].index, far_middle[child].index};
      for (int b = 0; b < 5; ++b)
        for (int k = 0; k < 4; ++k) bar[child][b][k] = value(challenger[b], lattice.direction[c[k]]) - lattice.margin[c[k]];
      kept_[child].clear();
    }
    for (std::size_t at = 0; at < padded; at += kChunk) {
      const std::size_t size = std::min(padded - at, kChunk);
      for (int k = 0; k < 9; ++k) values_along(x_.data() + at, y_.data() + at, z_.data() + at, size, lattice.direction[k], value_[k]);
      for (int child = 0; child < 4; ++child) {
        const int* c = kCorner[child];
        compare(value_[c[0]], value_[c[1]], value_[c[2]], value_[c[3]], size, bar[child], beaten_);
        for (std::size_t i = 0; i < std::min(size, count - at); ++i)
          if (beaten_[i] == 0) kept_[child].push_back(static_cast<std::uint32_t>(at + i));
      }
    }
    for (int child = 0; child < 4; ++child) {
      if (kept_[child].size() > few_ && kept_[child].size() <= kCompareAll) compare_all(lattice, kCorner[child], kept_[child]);
      children[child].reserve(kept_[child].size());
      for (const std::uint32_t i : kept_[child]) children[child].push_back(from[i]);
    }
  }

 private:
  double value(std::size_t i, const Vec3d& direction) const { return direction.x * x_[i] + direction.y * y_[i] + direction.z * z_[i]; }

  void compare_all(const Lattice& lattice, const int* corner, std::vector<std::uint32_t>& kept) const {
    double at_corner[kCompareAll][4];
    for (std::size_t i = 0; i < kept.size(); ++i)
      for (int k = 0; k < 4; ++k) at_corner[i][k] = value(kept[i], lattice.direction[corner[k]]);
    std::size_t end = 0;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      bool beaten = false;
      for (std::size_t j = 0; j < kept.size() && !beaten; ++j) {
        // One that was beaten itself may serve: what beat it beats the other, too, by more.
        beaten = true;
        for (int k = 0; k < 4; ++k) beaten = beaten && at_corner[i][k] < at_corner[j][k] - lattice.margin[corner[k]];
      }
      if (!beaten) kept[end++] = kept[i];
    }
    kept.resize(end);
  }

  static constexpr std::size_t kChunk = 512, kSampleFrom = 16 * kChunk;
  std::size_t few_ = 6;
  std::vector<double> x_, y_, z_;
  double value_[9][kChunk], beaten_[kChunk];
  std::vector<std::uint32_t> kept_[4];
};

// A square of the unfolded map: 2^level cells along each axis.
struct Cell {
  std::uint32_t u, v;
  std::vector<std::uint32_t> list;   // vertices that may be farthest somewhere in it, ascending
  std::uint32_t word = 0;            // below the grid: where its word stands
  bool final = false;
};

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

  const auto add_list = [&](const std::vector<std::uint32_t>& list) {
    const auto at = static_cast<std::uint32_t>(table.lists.size());
    table.lists.push_back(static_cast<std::uint32_t>(list.size()));
    table.lists.insert(table.lists.end(), list.begin(), list.end());
    return at;
  };

  // Level by level, from the whole square: its four quadrants each hold an upper and a lower face of the octahedron.
  std::vector<Cell> cells(1);
  cells[0] = {0, 0, std::vector<std::uint32_t>(vertices.size()), 0, false};
  std::iota(cells[0].list.begin(), cells[0].list.end(), 0u);
  for (int level = 0; !cells.empty(); ++level) {
    std::vector<Cell> children(4 * cells.size());
#pragma omp parallel for schedule(dynamic, 16) if (cells.size() > 1 && vertices.size() > 1000)
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const FpEnvironment environment;
      static thread_local Divider divide;
      divide.set_few(few);
      const Cell& cell = cells[k];
      std::vector<std::uint32_t> lists[4];
      divide(vertices, cell.list, lattice_of(cell.u, cell.v, level, margin), lists);
      std::size_t sum = 0;
      for (const auto& list : lists) sum += list.size();
      // Where dividing hardly shortens the lists (coplanar vertices, or all vertices alike from far away), it ends.
      const bool in_vain = level > 3 && 4 * sum > 14 * cell.list.size();
      for (std::uint32_t q = 0; q < 4; ++q) {
        const bool final = lists[q].size() <= few || level + 1 >= deepest || in_vain;
        children[4 * k + q] = {2 * cell.u + (q & 1), 2 * cell.v + (q >> 1), std::move(lists[q]), cell.word + q, final};
      }
    }
    cells.clear();
    for (Cell& cell : children) {
      const bool in_grid = level + 1 <= grid_level;
      if (cell.final) {
        const std::uint32_t at = add_list(cell.list);
        if (!in_grid) {
          table.cells[cell.word] = at;
          continue;
        }
        const int bits = grid_level - (level + 1);
        for (std::size_t v = std::size_t{cell.v} << bits; v < std::size_t{cell.v + 1} << bits; ++v)
          for (std::size_t u = std::size_t{cell.u} << bits; u < std::size_t{cell.u + 1} << bits; ++u) table.cells[v * grid + u] = at;
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
  // Cells must point at where a list begins.
  std::vector<bool> begins(table.lists.size(), false);
  for (std::size_t i = 0; i < table.lists.size(); i += table.lists[i] + 1) begins[i] = true;
  return std::all_of(table.cells.begin(), table.cells.end(),
                     [&](std::uint32_t word) { return (word & DirectionTable::kDivided) || begins[word]; });
}

}  // namespace clearance
