// Extents of a hull, measured alike on the host and on a device.
#pragma once

#include <cmath>
#include <cstdint>

#include "engine/hull/convex_part.h"

namespace clearance {

/// Rounds a length up past every rounding made in computing it (a few operations, each within 2^-53).
CLEARANCE_HD inline double padded(double length) {
  return length * (1 + 8 * 0x1p-52);
}

/// Sets centre, half, rho and spread of a hull.
/// \param vertex returns the vertex of an index below `count`, which is at least 1
template <class Vertex>
CLEARANCE_HD inline void measure_hull(std::uint32_t count, const Vertex& vertex, HullExtents& hull) {
  Vec3d low = vertex(0), high = low;
  for (std::uint32_t i = 1; i < count; ++i) {
    const Vec3d v = vertex(i);
    for (int k = 0; k < 3; ++k) {
      low[k] = v[k] < low[k] ? v[k] : low[k];
      high[k] = v[k] > high[k] ? v[k] : high[k];
    }
  }
  hull.centre = 0.5 * low + 0.5 * high;
  for (int k = 0; k < 3; ++k) {
    const double above = high[k] - hull.centre[k], below = hull.centre[k] - low[k];
    hull.half[k] = padded(above < below ? below : above);
  }
  double rho2 = 0, spread2 = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Vec3d v = vertex(i);
    const double from_origin = squared_norm(v), from_centre = squared_norm(v - hull.centre);
    rho2 = rho2 < from_origin ? from_origin : rho2;
    spread2 = spread2 < from_centre ? from_centre : spread2;
  }
  using std::sqrt;
  hull.rho = padded(sqrt(rho2));
  hull.spread = padded(sqrt(spread2));
}

}  // namespace clearance
