#include "engine/hull/cell_division.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "engine/base/clones.h"

namespace clearance {

namespace {

constexpr std::size_t kCompareAll = 32;  // lists up to this length are compared each with each

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

Lattice lattice_of(const MapSquare& square, double margin) {
  Lattice l;
  const double half = 1.0 / static_cast<double>(1u << square.level);  // of the square's edge
  for (int k = 0; k < 9; ++k) {
    l.direction[k] = direction_at(-1 + half * (2 * square.u + k % 3), -1 + half * (2 * square.v + k / 3));
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

}  // namespace

void divide_list(std::span<const Vec3d> vertices, const std::vector<std::uint32_t>& list, const MapSquare& square,
                 double margin, std::vector<std::uint32_t> (&children)[4]) {
  static thread_local Divider divide;
  divide(vertices, list, lattice_of(square, margin), children);
}

}  // namespace clearance
