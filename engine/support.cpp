#include "support.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "clones.h"
#include "direction_table.h"

namespace clearance {

namespace {

constexpr double kUnitRoundoff = 0x1p-53;

// Eight lanes keep their own best, in vectors of the compiler's (GCC and Clang) since neither loops over arrays nor branches
// are fast enough: which vertex is the best so far cannot be predicted.
using Eight = double __attribute__((vector_size(64)));

// n . v of eight vertices.
inline void reach(const Vec3d& n, const double* px, const double* py, const double* pz, Eight& s) {
  Eight x, y, z;
  std::memcpy(&x, px, sizeof x);
  std::memcpy(&y, py, sizeof y);
  std::memcpy(&z, pz, sizeof z);
  s = n.x * x + n.y * y + n.z * z;
}

// \param take takes the second into the first, lane by lane.
template <class Take>
inline double fold(const Eight& lanes, const Take& take) {
  using Four = double __attribute__((vector_size(32)));
  using Two = double __attribute__((vector_size(16)));
  Four four[2];
  std::memcpy(four, &lanes, sizeof lanes);
  take(four[0], four[1]);
  Two two[2];
  std::memcpy(two, four, sizeof two);
  take(two[0], two[1]);
  double low = two[0][0];
  take(low, double{two[0][1]});
  return low;
}

CLEARANCE_CLONES SupportPoint<double> scan(const Piece& piece, const Vec3d& n) {
  constexpr std::size_t kLanes = 8;
  const std::size_t count = piece.x.size();  // padded to a multiple of eight
  const double *x = piece.x.data(), *y = piece.y.data(), *z = piece.z.data();
  const Eight lane{0, 1, 2, 3, 4, 5, 6, 7};
  Eight best, index = lane;
  reach(n, x, y, z, best);
  for (std::size_t i = kLanes; i < count; i += kLanes) {
    Eight s;
    reach(n, x + i, y + i, z + i, s);
    const Eight here = lane + static_cast<double>(i);
    index = s > best ? here : index;
    best = s > best ? s : best;
  }
  const double top = fold(best, [](auto& p, const auto& q) { p = q > p ? q : p; });
  const Eight none = Eight{} + static_cast<double>(count), tops = best == top ? index : none;
  const double first = fold(tops, [](auto& p, const auto& q) { p = q < p ? q : p; });
  return {first < static_cast<double>(count) ? static_cast<std::uint32_t>(first) : 0, top};  // 0: a direction that is no number
}

double upper_length(const Vec3d& n) { return norm(n) * (1 + 4 * kUnitRoundoff); }

}  // namespace

SupportPoint<double> support(const Piece& piece, const Vec3d& n) {
  if (!piece.table) return scan(piece, n);
  const std::span<const std::uint32_t> candidates = piece.table->candidates(n);
  SupportPoint<double> best{candidates[0], dot(n, piece.vertices[candidates[0]])};
  for (const std::uint32_t i : candidates.subspan(1))
    if (const double s = dot(n, piece.vertices[i]); s > best.value) best = {i, s};
  return best;
}

// Only vertices whose double value is within rounding of the best double value can be the exact maximum:
// |computed - exact| <= 4 u |n| rho for each (n itself is rounded to double first), so twice that separates two of them.
SupportPoint<DoubleDouble> support(const Piece& piece, const Vec3<DoubleDouble>& n) {
  const Vec3d n_hi{n.x.hi, n.y.hi, n.z.hi};
  const SupportPoint<double> guess = support(piece, n_hi);
  const double threshold = guess.value - 10 * kUnitRoundoff * upper_length(n_hi) * piece.rho;
  SupportPoint<DoubleDouble> best{guess.index, dot(n, cast<DoubleDouble>(piece.vertices[guess.index]))};
  const auto consider = [&](std::uint32_t index) {
    const Vec3d& v = piece.vertices[index];
    if (dot(n_hi, v) < threshold) return;
    const DoubleDouble s = dot(n, cast<DoubleDouble>(v));
    if (s > best.value || (s == best.value && index < best.index)) best = {index, s};
  };
  if (piece.table)
    for (const std::uint32_t i : piece.table->candidates(n_hi)) consider(i);
  else
    for (std::uint32_t i = 0; i < piece.vertices.size(); ++i) consider(i);
  return best;
}

}  // namespace clearance
