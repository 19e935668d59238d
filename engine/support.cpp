#include "support.h"

#include <algorithm>
#include <cmath>

#include "clones.h"
#include "direction_table.h"

namespace clearance {

namespace {

constexpr double kUnitRoundoff = 0x1p-53;

// Eight lanes keep their own best, so that the loop has no chain of dependent comparisons and the compiler vectorises it.
CLEARANCE_CLONES SupportPoint<double> scan(const Piece& piece, const Vec3d& n) {
  constexpr int kLanes = 8;
  const std::size_t count = piece.vertices.size();
  const double *x = piece.x.data(), *y = piece.y.data(), *z = piece.z.data();
  SupportPoint<double> best{0, dot(n, Vec3d{x[0], y[0], z[0]})};
  std::size_t i = 0;
  if (count >= 2 * kLanes) {
    double lane_best[kLanes], lane_index[kLanes];
    for (int k = 0; k < kLanes; ++k) {
      lane_best[k] = n.x * x[k] + n.y * y[k] + n.z * z[k];
      lane_index[k] = k;
    }
    for (i = kLanes; i + kLanes <= count; i += kLanes)
      for (int k = 0; k < kLanes; ++k) {
        const double s = n.x * x[i + k] + n.y * y[i + k] + n.z * z[i + k];
        const bool better = s > lane_best[k];
        lane_best[k] = better ? s : lane_best[k];
        lane_index[k] = better ? static_cast<double>(i + k) : lane_index[k];
      }
    best = {static_cast<std::uint32_t>(lane_index[0]), lane_best[0]};
    for (int k = 1; k < kLanes; ++k) {
      const auto index = static_cast<std::uint32_t>(lane_index[k]);
      if (lane_best[k] > best.value || (lane_best[k] == best.value && index < best.index)) best = {index, lane_best[k]};
    }
  }
  for (; i < count; ++i) {
    const double s = n.x * x[i] + n.y * y[i] + n.z * z[i];
    if (s > best.value) best = {static_cast<std::uint32_t>(i), s};
  }
  return best;
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
