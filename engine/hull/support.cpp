#include "engine/hull/support.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "engine/base/instruction_sets.h"
#include "engine/hull/direction_table.h"
#include "engine/hull/primitive.h"
#include "engine/hull/scan.h"

namespace clearance {

namespace {

constexpr double kUnitRoundoff = 0x1p-53;

// The widest instruction set that this machine has.
Scan best_scan() {
#ifdef CLEARANCE_LANES_X86
  if (has_avx512_lanes()) return lanes_scan_avx512::scan;
  if (has_avx2_lanes()) return lanes_scan_avx2::scan;
#endif
  return lanes_scan_baseline::scan;
}

SupportPoint<double> scan(const ConvexPart& part, const Vec3d& n) {
  static const Scan run = best_scan();
  const std::size_t count = part.x.size();
  return run({part.x.data(), part.y.data(), part.z.data(), count}, n);
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

SupportPoint<double> support(const ConvexPart& part, const Vec3d& n) {
  if (part.primitive) return {0, reach_of(*part.primitive, n)};
  assert(!part.vertices.empty() && part.x.size() % kScanBlock == 0);
  if (!part.table) return scan(part, n);
  const std::span<const std::uint32_t> candidates = part.table->candidates(n);
  assert(!candidates.empty());
  SupportPoint<double> best{candidates[0], dot(n, part.vertices[candidates[0]])};
  for (const std::uint32_t i : candidates.subspan(1))
    if (const double s = dot(n, part.vertices[i]); s > best.value) best = {i, s};
  return best;
}

double reach_of_core(const ConvexPart& part, const Vec3d& n) {
  constexpr double kSame = 0x1p-46;
  if (is_half_space(part) && std::hypot(n.x, n.y) <= kSame * n.z) return 0;
  return support(part, n).value;
}

// Only vertices whose double value is within rounding of the best double value can be the exact maximum: |computed -
// exact| <= 4 u |n| rho for each (n itself is rounded to double first), so twice that separates two of them.
SupportPoint<DoubleDouble> support(const ConvexPart& part, const Vec3<DoubleDouble>& n) {
  if (part.primitive) return {0, reach_of(*part.primitive, n)};
  const Vec3d n_hi{n.x.hi, n.y.hi, n.z.hi};
  const SupportPoint<double> guess = support(part, n_hi);
  const double threshold = guess.value - 10 * kUnitRoundoff * upper_length(n_hi) * part.rho;
  SupportPoint<DoubleDouble> best{guess.index, dot(n, cast<DoubleDouble>(part.vertices[guess.index]))};
  const auto consider = [&](std::uint32_t index) {
    const Vec3d& v = part.vertices[index];
    if (dot(n_hi, v) < threshold) return;
    const DoubleDouble s = dot(n, cast<DoubleDouble>(v));
    if (s > best.value || (s == best.value && index < best.index)) best = {index, s};
  };
  if (part.table)
    for (const std::uint32_t i : part.table->candidates(n_hi)) consider(i);
  else
    for (std::uint32_t i = 0; i < part.vertices.size(); ++i) consider(i);
  return best;
}

}  // namespace clearance
