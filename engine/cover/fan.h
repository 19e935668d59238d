// Tetrahedra that cover a convex hull.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/hull/convex_part.h"

namespace clearance {

struct Fan {
  std::vector<Vec3d> points;
  std::vector<std::array<std::uint32_t, 4>> parts;  ///< indices of points
  double off = 0;                                   ///< bound on the hull's distance from the tetrahedra, metres
};

/// Tetrahedra from a point within the hull to each face that Qhull guesses. Nothing if the faces are not proved to
/// close around the point (docs/trust/bounds_covers.md, "Shares"), as for flat hulls.
std::optional<Fan> fan_of(std::span<const Vec3d> vertices);

/// The box around a part's core, which is not contained in the part.
Fan box_around(const ConvexPart& part);

}  // namespace clearance
