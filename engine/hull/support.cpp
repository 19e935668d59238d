#include "engine/hull/support.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/base/clones.h"
#include "engine/hull/direction_table.h"
#include "engine/hull/primitive.h"

namespace clearance {

namespace {

constexpr double kUnitRoundoff = 0x1p-53;

// Compiler vectors (GCC and Clang), since neither loops over arrays nor branches are fast enough: the best vertex so
// far cannot be predicted. Each instruction set has those that fit its registers; wider ones would be split into single
// numbers.
using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));
using Eight = double __attribute__((vector_size(64)));

// Reduces a vector to one number.
// \param take merges the second operand into the first, lane by lane
template <class Take>
__attribute__((always_inline)) inline double fold(const Two& lanes, const Take& take) {
  double first = lanes[0];
  take(first, double{lanes[1]});
  return first;
}
template <class Half, class Vector, class Take>
__attribute__((always_inline)) inline double fold_halves(const Vector& lanes, const Take& take) {
  Half half[2];
  std::memcpy(half, &lanes, sizeof lanes);
  take(half[0], half[1]);
  return fold(half[0], take);
}
template <class Take>
__attribute__((always_inline)) inline double fold(const Four& lanes, const Take& take) {
  return fold_halves<Two>(lanes, take);
}
template <class Take>
__attribute__((always_inline)) inline double fold(const Eight& lanes, const Take& take) {
  return fold_halves<Four>(lanes, take);
}

template <class Vector>
__attribute__((always_inline)) inline SupportPoint<double> scan_in(const Piece& piece, const Vec3d& n) {
  constexpr std::size_t kWidth = sizeof(Vector) / sizeof(double), kParts = 8 / kWidth;
  const std::size_t count = piece.x.size();  // padded to a multiple of eight
  const auto reach = [&](std::size_t i, Vector& s) {
    Vector x, y, z;
    std::memcpy(&x, piece.x.data() + i, sizeof x);
    std::memcpy(&y, piece.y.data() + i, sizeof y);
    std::memcpy(&z, piece.z.data() + i, sizeof z);
    s = n.x * x + n.y * y + n.z * z;
  };
  Vector lane, best[kParts], index[kParts];
  for (std::size_t i = 0; i < kWidth; ++i) lane[i] = static_cast<double>(i);
  for (std::size_t k = 0; k < kParts; ++k) {
    reach(k * kWidth, best[k]);
    index[k] = lane + static_cast<double>(k * kWidth);
  }
  for (std::size_t i = 8; i < count; i += 8)
    for (std::size_t k = 0; k < kParts; ++k) {
      Vector s;
      reach(i + k * kWidth, s);
      const Vector here = lane + static_cast<double>(i + k * kWidth);
      index[k] = s > best[k] ? here : index[k];
      best[k] = s > best[k] ? s : best[k];
    }
  const auto take_more = [](auto& p, const auto& q) { p = q > p ? q : p; };
  const auto take_less = [](auto& p, const auto& q) { p = q < p ? q : p; };
  Vector all = best[0];
  for (std::size_t k = 1; k < kParts; ++k) take_more(all, best[k]);
  const double top = fold(all, take_more);
  const Vector none = Vector{} + static_cast<double>(count);
  Vector tops = none;
  for (std::size_t k = 0; k < kParts; ++k) {
    const Vector i = best[k] == top ? index[k] : none;
    take_less(tops, i);
  }
  const double first = fold(tops, take_less);
  return {first < static_cast<double>(count) ? static_cast<std::uint32_t>(first) : 0,
          top};  // 0 for a direction with NaN
}

#ifdef CLEARANCE_VERSIONS
__attribute__((target("avx512f"))) SupportPoint<double> scan(const Piece& piece, const Vec3d& n) {
  return scan_in<Eight>(piece, n);
}
__attribute__((target("avx2"))) SupportPoint<double> scan(const Piece& piece, const Vec3d& n) {
  return scan_in<Four>(piece, n);
}
__attribute__((target("default")))
#endif
SupportPoint<double>
scan(const Piece& piece, const Vec3d& n) {
  return scan_in<Two>(piece, n);
}

double upper_length(const Vec3d& n) {
  return norm(n) * (1 + 4 * kUnitRoundoff);
}

// Reach of a core in closed form along n.
template <class T>
T reach_of(const Primitive& primitive, const Vec3<T>& n) {
  if (primitive.kind != Primitive::Kind::kHalfSpace) return farthest(primitive, n).value;
  const T zero(0);
  return n.x == zero && n.y == zero && !(n.z < zero) ? zero : T(std::numeric_limits<double>::infinity());
}

}  // namespace

SupportPoint<double> support(const Piece& piece, const Vec3d& n) {
  if (piece.primitive) return {0, reach_of(*piece.primitive, n)};
  assert(!piece.vertices.empty() && piece.x.size() % 8 == 0);
  if (!piece.table) return scan(piece, n);
  const std::span<const std::uint32_t> candidates = piece.table->candidates(n);
  assert(!candidates.empty());
  SupportPoint<double> best{candidates[0], dot(n, piece.vertices[candidates[0]])};
  for (const std::uint32_t i : candidates.subspan(1))
    if (const double s = dot(n, piece.vertices[i]); s > best.value) best = {i, s};
  return best;
}

// Only vertices whose double value is within rounding of the best double value can be the exact maximum: |computed -
// exact| <= 4 u |n| rho for each (n itself is rounded to double first), so twice that separates two of them.
SupportPoint<DoubleDouble> support(const Piece& piece, const Vec3<DoubleDouble>& n) {
  if (piece.primitive) return {0, reach_of(*piece.primitive, n)};
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
