// Tetrahedra that cover a convex hull.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/hull/piece.h"

namespace clearance {

struct Fan {
  std::vector<Vec3d> points;
  std::vector<std::array<std::uint32_t, 4>> parts;  ///< of points
  double off = 0;                                   ///< metres: no point of the hull is farther from all parts
};

/// From a point within the hull to each of its faces, as Qhull has guessed them: none where it is not proved that they
/// go all around (docs/bounds.md, "Decompositions"), as of flat hulls.
std::optional<Fan> fan_of(std::span<const Vec3d> vertices);

/// The box around a piece's core, which is not all of it within the piece.
Fan box_around(const Piece& piece);

}  // namespace clearance
