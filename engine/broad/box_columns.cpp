#include "engine/broad/box_columns.h"

#include <limits>

#include "engine/base/clones.h"

namespace clearance {

CLEARANCE_CLONES __attribute__((flatten)) void box_gaps(const Aabb& a, const BoxColumnsView& b, std::size_t count,
                                                        double* __restrict gaps) {
  const double *lx = b.column[0], *ly = b.column[1], *lz = b.column[2];
  const double *hx = b.column[3], *hy = b.column[4], *hz = b.column[5];
  const Aabb box = a;
  for (std::size_t i = 0; i < count; ++i)
    gaps[i] = certify_box_gap(box, {{lx[i], ly[i], lz[i]}, {hx[i], hy[i], hz[i]}});
}

CLEARANCE_CLONES __attribute__((flatten)) void box_gaps(const BoxColumnsView& a, const BoxColumnsView& b,
                                                        std::size_t count, double* __restrict gaps) {
  const double *alx = a.column[0], *aly = a.column[1], *alz = a.column[2];
  const double *ahx = a.column[3], *ahy = a.column[4], *ahz = a.column[5];
  const double *lx = b.column[0], *ly = b.column[1], *lz = b.column[2];
  const double *hx = b.column[3], *hy = b.column[4], *hz = b.column[5];
  for (std::size_t i = 0; i < count; ++i)
    gaps[i] = certify_box_gap({{alx[i], aly[i], alz[i]}, {ahx[i], ahy[i], ahz[i]}},
                              {{lx[i], ly[i], lz[i]}, {hx[i], hy[i], hz[i]}});
}

std::size_t gaps_within(const double* gaps, std::size_t count, double max_distance, std::uint32_t* near) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < count; ++i) {  // without a branch: few are near, and which ones cannot be predicted
    near[found] = static_cast<std::uint32_t>(i);
    found += !(gaps[i] > max_distance) | !(gaps[i] < std::numeric_limits<double>::infinity());
  }
  return found;
}

}  // namespace clearance
