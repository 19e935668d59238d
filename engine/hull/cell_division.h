// Division of a direction table's cell: which of its vertices may be farthest in each quarter.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vec.h"

namespace clearance {

/// A square of the unfolded map of directions (direction_table.h), which has 2^level of them along each axis.
struct MapSquare {
  std::uint32_t u, v;
  int level;
};

/// Divides the list of a square's vertices among its four children (low u, low v first; then high u). Each leaves out
/// the vertices that one other beats at all its corners.
/// \param margin that a difference of two computed values must exceed to be sure, for directions of length 1
void divide_list(std::span<const Vec3d> vertices, const std::vector<std::uint32_t>& list, const MapSquare& square,
                 double margin, std::vector<std::uint32_t> (&children)[4]);

}  // namespace clearance
