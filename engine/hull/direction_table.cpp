#include "engine/hull/direction_table.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numeric>

#include "engine/base/clones.h"
#include "engine/base/fp_environment.h"

namespace clearance {

namespace {

constexpr std::size_t kCompareAll = 32;  // lists up to this length are compared each with each
constexpr int kBelowGrid = 6;            // maximum divisions of a cell of the grid
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
  double margin[9];  // that a difference of two computed values must exceed to be sure
};

Lattice lattice_of(std::uint32_t u, std::uint32_t v, int level, double margin) {
  Lattice l;
  const double half = 1.0 / static_cast<double>(1u << level);  // of a cell's edge
  for (int k = 0; k < 9; ++k) {
    l.direction[k] = direction_at(-1 + half * (2 * u + k % 3), -1 + half * (2 * v + k / 3));
    l.margin[k] = margin * norm(l.direction[k]);
  }
  return l;
}
constexpr int kCorner[4][4] = {{0, 1, 3, 4}, {1, 2, 4, 5}, {3, 4, 6, 7}, {4, 5, 7, 8}};  // of each child

// As many as a register of AVX2 holds, which all but old machines have and is chosen at run time; elsewhere two.
#ifdef __x86_64__
constexpr std::size_t kLanes = 4;
#else
constexpr std::size_t kLanes = 2;
#endif
constexpr std::size_t kChunk = 512;
typedef double Lanes __attribute__((vector_size(8 * kLanes)));
typedef std::int64_t Mask __attribute__((vector_size(8 * kLanes)));
typedef double LanesInMemory __attribute__((vector_size(8 * kLanes), may_alias));  // of doubles on such a boundary
struct Column {
  alignas(8 * kLanes) double at[kChunk];  // explicit: a vector's alignment depends on the instruction set
  LanesInMemory& lanes(std::size_t i) { return *reinterpret_cast<LanesInMemory*>(at + i); }
  const LanesInMemory& lanes(std::size_t i) const { return *reinterpret_cast<const LanesInMemory*>(at + i); }
};

// values[k].at[i] = directions[k] . v_i, for a multiple of kLanes vertices.
CLEARANCE_CLONES void values_along(const double* x, const double* y, const double* z, std::size_t padded,
                                   const Vec3d (&directions)[9], Column (&values)[9]) {
  for (std::size_t i = 0; i < padded; i += kLanes) {
    Lanes px, py, pz;
    std::memcpy(&px, x + i, sizeof px);
    std::memcpy(&py, y + i, sizeof py);
    std::memcpy(&pz, z + i, sizeof pz);
    for (int k = 0; k < 9; ++k) values[k].lanes(i) = directions[k].x * px + directions[k].y * py + directions[k].z * pz;
  }
}

struct Farthest {
  double value = -1e300;
  std::size_t index = 0;
};
// Merges the largest values, and the largest sums of the values at each child's corners, into those found so far.
// \param first the index of the first vertex
CLEARANCE_CLONES void farthest(const Column (&values)[9], std::size_t padded, std::size_t first,
                               Farthest (&found)[13]) {
  for (int k = 0; k < 13; ++k) {
    const int* c = kCorner[k < 9 ? 0 : k - 9];
    Lanes best = Lanes{} - 1e300;
    Mask index{};
    for (std::size_t i = 0; i < padded; i += kLanes) {
      const Lanes v =
          k < 9 ? values[k].lanes(i)
                : (values[c[0]].lanes(i) + values[c[1]].lanes(i)) + (values[c[2]].lanes(i) + values[c[3]].lanes(i));
      const Mask better = v > best;
      best = better ? v : best;
      index = better ? Mask{} + static_cast<std::int64_t>(i) : index;
    }
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (best[lane] > found[k].value) found[k] = {best[lane], first + static_cast<std::size_t>(index[lane]) + lane};
  }
}

// Sets beaten[i] to nonzero if one of the bars is above all four values of i.
CLEARANCE_CLONES void compare(const Column& s0, const Column& s1, const Column& s2, const Column& s3,
                              std::size_t padded, const double (*bar)[4], std::size_t bars, std::int64_t* beaten) {
  for (std::size_t i = 0; i < padded; i += kLanes) {
    const Lanes a = s0.lanes(i), b = s1.lanes(i), c = s2.lanes(i), d = s3.lanes(i);
    Mask any{};
    for (std::size_t k = 0; k < bars; ++k) any |= (a < bar[k][0]) & (b < bar[k][1]) & (c < bar[k][2]) & (d < bar[k][3]);
    std::memcpy(beaten + i, &any, sizeof any);
  }
}

// Divides the list of a cell among its children: each leaves out the vertices that one other beats at all its corners.
class Divider {
 public:
  void operator()(std::span<const Vec3d> vertices, const std::vector<std::uint32_t>& from, const Lattice& lattice,
                  std::vector<std::uint32_t> (&children)[4]) {
    gather(vertices, from);
    for (int child = 0; child < 4; ++child) kept_[child].resize(padded_), kept_count_[child] = 0;
    // Any vertex may challenge, even one that was beaten: its winner beats the others by more.
    if (count_ <= kCompareAll)
      challenge_all(lattice);
    else
      challenge_farthest(lattice);
    for (int child = 0; child < 4; ++child) {
      children[child].resize(kept_count_[child]);
      for (std::size_t i = 0; i < kept_count_[child]; ++i) children[child][i] = from[kept_[child][i]];
    }
  }

 private:
  static constexpr std::size_t kSampleFrom = 16 * kChunk, kFarthest = 5;

  void gather(std::span<const Vec3d> vertices, const std::vector<std::uint32_t>& from) {
    count_ = from.size();
    padded_ = (count_ + kLanes - 1) / kLanes * kLanes;
    for (std::vector<double>* column : {&x_, &y_, &z_}) column->resize(padded_);
    for (std::size_t i = 0; i < padded_; ++i) {
      const Vec3d& v = vertices[from[i < count_ ? i : 0]];
      x_[i] = v.x, y_[i] = v.y, z_[i] = v.z;
    }
  }
  // Values of the vertices from `at` on along the lattice's directions. Returns their number, padded.
  std::size_t compute_values(const Lattice& lattice, std::size_t at) {
    const std::size_t size = std::min(padded_ - at, kChunk);
    values_along(x_.data() + at, y_.data() + at, z_.data() + at, size, lattice.direction, value_);
    return size;
  }
  // Keeps those vertices from `at` on that no bar beats.
  void keep(int child, std::size_t at, std::size_t size, const double (*bar)[4], std::size_t bars) {
    const int* c = kCorner[child];
    compare(value_[c[0]], value_[c[1]], value_[c[2]], value_[c[3]], size, bar, bars, beaten_);
    std::uint32_t* kept = kept_[child].data();
    std::size_t n = kept_count_[child];
    for (std::size_t i = 0; i < std::min(size, count_ - at); ++i) {
      kept[n] = static_cast<std::uint32_t>(at + i);
      n += beaten_[i] == 0;
    }
    kept_count_[child] = n;
  }

  void challenge_all(const Lattice& lattice) {
    const std::size_t size = compute_values(lattice, 0);
    double bar[kCompareAll][4];
    for (int child = 0; child < 4; ++child) {
      for (int k = 0; k < 4; ++k) {
        const int corner = kCorner[child][k];
        for (std::size_t b = 0; b < count_; ++b) bar[b][k] = value_[corner].at[b] - lattice.margin[corner];
      }
      keep(child, 0, size, bar, count_);
    }
  }

  // Challengers: the farthest vertex along each lattice direction, and along the middle of each child's corners.
  void challenge_farthest(const Lattice& lattice) {
    Farthest far[13];
    // A long list is only sampled, since its cell is divided again anyway.
    const std::size_t stride = count_ > kSampleFrom ? 8 * kChunk : kChunk;
    for (std::size_t at = 0; at < padded_; at += stride) {
      const std::size_t size = compute_values(lattice, at);
      farthest(value_, size, at, far);
    }
    double bar[4][kFarthest][4];
    for (int child = 0; child < 4; ++child) {
      const int* c = kCorner[child];
      const std::size_t challenger[kFarthest] = {far[c[0]].index, far[c[1]].index, far[c[2]].index, far[c[3]].index,
                                                 far[9 + child].index};
      for (std::size_t b = 0; b < kFarthest; ++b)
        for (int k = 0; k < 4; ++k)
          bar[child][b][k] = value(challenger[b], lattice.direction[c[k]]) - lattice.margin[c[k]];
    }
    for (std::size_t at = 0; at < padded_; at += kChunk) {
      const std::size_t size = padded_ > kChunk ? compute_values(lattice, at) : padded_;
      for (int child = 0; child < 4; ++child) keep(child, at, size, bar[child], kFarthest);
    }
  }
  double value(std::size_t i, const Vec3d& direction) const {
    return direction.x * x_[i] + direction.y * y_[i] + direction.z * z_[i];
  }

  std::size_t count_ = 0, padded_ = 0;
  std::vector<double> x_, y_, z_;
  Column value_[9];
  std::int64_t beaten_[kChunk];
  std::vector<std::uint32_t> kept_[4];
  std::size_t kept_count_[4];
};

// A square of the unfolded map: 2^level cells along each axis.
struct Cell {
  std::uint32_t u, v;
  std::vector<std::uint32_t> list;  // vertices that may be farthest somewhere in it, ascending
  std::uint32_t word = 0;           // below the grid: index of its word
  bool final = false;
};

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
    std::vector<Cell> children(4 * cells.size());
#pragma omp parallel for schedule(dynamic, 16) if (cells.size() > 1 && vertices.size() > 1000)
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const FpEnvironment environment;
      static thread_local Divider divide;
      const Cell& cell = cells[k];
      std::vector<std::uint32_t> lists[4];
      divide(vertices, cell.list, lattice_of(cell.u, cell.v, level, margin), lists);
      std::size_t sum = 0;
      for (const auto& list : lists) sum += list.size();
      // Division ends if it hardly shortens the lists (coplanar vertices, or all vertices alike from far away).
      const bool in_vain = level > 3 && 4 * sum > 14 * cell.list.size();
      for (std::uint32_t q = 0; q < 4; ++q) {
        const bool final = lists[q].size() <= few || level + 1 >= deepest || in_vain;
        children[4 * k + q] = {2 * cell.u + (q & 1), 2 * cell.v + (q >> 1), std::move(lists[q]), cell.word + q, final};
      }
    }
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
