// Choice of the moved bodies that a query's kernels place.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/device/query_setup.h"

namespace clearance::cuda {

/// Indices of the moved bodies whose poses kernels read: those with geometry on the device, and the frames of joint
/// columns. The other bodies only carry these.
/// \param has_hull called as has_hull(body): whether a body has convex parts on the device
template <class HasHull>
std::vector<std::uint32_t> placed_slots(const QuerySetup& s, const HasHull& has_hull) {
  std::vector<std::uint8_t> is_read(s.moved.bodies.size());
  const auto read = [&](std::uint32_t ref) {
    if (ref != kNone && (ref & kMovedBit)) is_read[ref & ~kMovedBit] = 1;
  };
  for (const JointMover& mover : s.movers.movers) {
    read(mover.link);
    read(mover.carrier);
  }
  std::vector<std::uint32_t> placed;
  for (std::uint32_t i = 0; i < is_read.size(); ++i) {
    const std::uint32_t body = s.moved.bodies[i];
    const bool has_elements = std::ranges::find(s.elements, body, &ElementBody::body) != s.elements.end();
    if (s.table || is_read[i] || has_elements || has_hull(body)) placed.push_back(i);
  }
  return placed;
}

}  // namespace clearance::cuda
