// Extents of a body whose convex parts are not on a device.
#pragma once

#include <algorithm>
#include <limits>

#include "engine/base/slack.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Extents around the whole body.
inline HullExtents extents_around(const Body& body) {
  if (body.parts.size() == 1) return body.parts[0]->extents();
  constexpr double kMore = 1 + 0x1p-48;
  HullExtents around;
  Vec3d low, high;
  for (int k = 0; k < 3; ++k) {
    low[k] = std::numeric_limits<double>::infinity();
    high[k] = -low[k];
  }
  for (const ConvexPartPtr& part : body.parts) {
    around.rho = std::max(around.rho, part->rho);
    around.radius = std::max(around.radius, part->radius);
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], difference_below(part->centre[k], part->half[k]));
      high[k] = std::max(high[k], sum_above(part->centre[k], part->half[k]));
    }
  }
  around.centre = 0.5 * low + 0.5 * high;
  for (int k = 0; k < 3; ++k) around.half[k] = std::max(high[k] - around.centre[k], around.centre[k] - low[k]) * kMore;
  around.spread = norm(around.half) * kMore;
  return around;
}

}  // namespace clearance
