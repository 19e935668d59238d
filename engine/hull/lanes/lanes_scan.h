// A scan in packs, compiled once for each instruction set (lanes_scan_avx512.cpp and similar).
#pragma once

#include <cstdint>

#include "engine/base/pack.h"
#include "engine/hull/scan.h"

namespace clearance {
namespace CLEARANCE_ISA {

// Without branches, since which vertex is the best so far cannot be predicted.
inline SupportPoint<double> scan_in_packs(const VertexColumns& v, const Vec3d& n) {
  using Real = Pack<double>;
  constexpr std::size_t kWidth = static_cast<std::size_t>(Real::kLanes), kPacks = kScanBlock / kWidth;
  const Vec3<Real> direction{Real(n.x), Real(n.y), Real(n.z)};
  const auto reach = [&](std::size_t i) {
    return direction.x * Real::load_unaligned(v.x + i) + direction.y * Real::load_unaligned(v.y + i) +
           direction.z * Real::load_unaligned(v.z + i);
  };
  constexpr double kOrder[kScanBlock] = {0, 1, 2, 3, 4, 5, 6, 7};
  const Real step(static_cast<double>(kScanBlock));
  Real best[kPacks], index[kPacks], here[kPacks];
  for (std::size_t k = 0; k < kPacks; ++k) {
    best[k] = reach(k * kWidth);
    index[k] = here[k] = Real::load_unaligned(kOrder + k * kWidth);
  }
  for (std::size_t i = kScanBlock; i < v.count; i += kScanBlock)
    for (std::size_t k = 0; k < kPacks; ++k) {
      const Real s = reach(i + k * kWidth);
      here[k] = here[k] + step;
      index[k] = select(s > best[k], here[k], index[k]);
      best[k] = max(s, best[k]);
    }
  Real all = best[0];
  for (std::size_t k = 1; k < kPacks; ++k) all = max(best[k], all);
  const double top = most_of(all);
  const Real none(static_cast<double>(v.count));
  double first = static_cast<double>(v.count);
  for (std::size_t k = 0; k < kPacks; ++k) {
    const double least = least_of(select(best[k] == Real(top), index[k], none));
    first = least < first ? least : first;
  }
  return {first < static_cast<double>(v.count) ? static_cast<std::uint32_t>(first) : 0, top};
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
