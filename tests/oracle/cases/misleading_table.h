// A convex part whose direction table is wrong in one place.
#pragma once

#include <algorithm>

#include "engine/hull/convex_part.h"
#include "engine/hull/direction_table.h"

namespace clearance::exact {

/// The part with a direction table that, along n (body frame), returns the least far vertex.
inline ConvexPartPtr with_misleading_table(const ConvexPart& part, const Vec3d& n) {
  ConvexPart cut = part;
  DirectionTable table = *cut.table;
  const std::span<const std::uint32_t> found = cut.table->candidates(n);
  const auto nearest = std::min_element(part.vertices.begin(), part.vertices.end(),
                                        [&](const Vec3d& p, const Vec3d& q) { return dot(n, p) < dot(n, q); });
  const auto at = table.lists.begin() + (found.data() - cut.table->lists.data());
  std::fill_n(at, found.size(), static_cast<std::uint32_t>(nearest - part.vertices.begin()));
  cut.table = std::make_shared<const DirectionTable>(std::move(table));
  return std::make_shared<const ConvexPart>(cut);
}

}  // namespace clearance::exact
