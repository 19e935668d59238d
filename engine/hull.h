// From the vertices that were loaded to the vertices of a piece.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math.h"
#include "piece.h"
#include "shapes.h"

namespace clearance {

/// The convex piece spanned by `vertices` and grown by `radius`.
///
/// Exact duplicates are merged; any other vertex is left out only if it is proved to lie inside the hull of those kept.
/// \param triangles faces that join the vertices, if there are any: a guess of the hull's edges, never part of a proof.
/// \param loaded_vertices how many there were before duplicates were merged by the caller; 0: those given.
/// Throws std::invalid_argument as make_piece() does.
PiecePtr make_hull_piece(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, double radius,
                         std::uint64_t loaded_vertices = 0);

}  // namespace clearance
