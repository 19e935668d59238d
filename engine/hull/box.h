// Boxes put together. For host and device.
#pragma once

#include <limits>

#include "engine/narrow/certify.h"

namespace clearance {

/// Holds nothing (low > high), and adds nothing to what it is joined with.
inline constexpr Aabb kEmptyBox{{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()},
                                {-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}};

/// The least box that holds both.
CLEARANCE_HD inline Aabb joined(const Aabb& a, const Aabb& b) {
  Aabb box;
  for (int k = 0; k < 3; ++k) {
    box.low[k] = b.low[k] < a.low[k] ? b.low[k] : a.low[k];
    box.high[k] = a.high[k] < b.high[k] ? b.high[k] : a.high[k];
  }
  return box;
}

}  // namespace clearance
