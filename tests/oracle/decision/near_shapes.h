// Bodies of every kind that balls of covers come near, and the distances of points from them in closed form.
#pragma once

#include <span>

#include "engine/scene/scene.h"

namespace clearance::exact {

/// The origin of its frame is in it or next to it.
struct NearShape {
  const char* name;
  Body body;                         ///< geometry alone
  double (*distance)(const Vec3d&);  ///< metres, of a point in the body's frame; at most 0 within the shape
};
/// One of each kind. The first kExactGaps are those whose gaps have the same bounds on both sides, the last of them a
/// half-space.
std::span<const NearShape> near_shapes();
inline constexpr std::size_t kExactGaps = 5;

}  // namespace clearance::exact
