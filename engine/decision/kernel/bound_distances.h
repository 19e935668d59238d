// Bounds on the distances of many states by covers, compiled once for each instruction set (decide_avx512.cpp and
// similar).
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/decision/kernel/distance_kernel.h"

namespace clearance {
namespace CLEARANCE_ISA {

inline void bound_distances(const DistanceBatch& batch, const DistanceRoom& room) {
  DistanceBounder bounder(batch, room);
  const std::size_t groups = batch.groups ? batch.groups->count : 1;
  std::uint32_t used = 0;
  for (std::size_t k = 0; k < batch.states; ++k) {
    DistanceBounds* const bounds = room.bounds + k * groups;
    for (std::size_t g = 0; g < groups; ++g) bounds[g] = {};
    if (!bounder.place(k)) continue;
    if (batch.groups)
      bounder.bound_groups(k, used, bounds);
    else
      *bounds = bounder.bound(k, used);
    for (std::size_t g = 0; g < groups; ++g)
      if (bounds[g].is_listed) used = bounds[g].left_end;
  }
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
