// Device-side lookups of engine/state/pair_table.h.
#pragma once

#include "engine/device/reduced_layout.h"

namespace clearance::cuda {

// Whether a's row excludes b, a < b.
// \param before number of excluded bodies in the row that are less than b
__device__ inline bool is_excluded(const TableView& t, std::uint32_t a, std::uint32_t b, std::uint32_t& before) {
  const std::uint32_t* const begin = t.excluded + t.excluded_begin[a];
  std::uint32_t low = 0, high = t.excluded_begin[a + 1] - t.excluded_begin[a];
  while (low < high) {
    const std::uint32_t middle = (low + high) / 2;
    if (begin[middle] < b)
      low = middle + 1;
    else
      high = middle;
  }
  before = low;
  return low < t.excluded_begin[a + 1] - t.excluded_begin[a] && begin[low] == b;
}
// PairTable::enabled() and position(), for a < b.
__device__ inline bool is_enabled(const TableView& t, std::uint32_t a, std::uint32_t b) {
  std::uint32_t before;
  return !(t.is_static[a] && t.is_static[b]) && !is_excluded(t, a, b, before);
}
__device__ inline std::uint32_t position_of(const TableView& t, std::uint32_t a, std::uint32_t b) {
  std::uint32_t before;
  is_excluded(t, a, b, before);
  const std::uint32_t partners = t.is_static[a] ? t.movable_before[b] - t.movable_before[a + 1] : b - a - 1;
  return static_cast<std::uint32_t>(t.row_begin[a] + partners - before);
}

}  // namespace clearance::cuda
