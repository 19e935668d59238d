// How far the hull of a mesh stands out of the mesh: what a concave body loses by being one convex piece.
#pragma once

#include <limits>
#include <optional>
#include <span>

#include "engine/base/vec.h"
#include "engine/hull/piece.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// Of a hull and the mesh whose vertices span it.
struct HullExcess {
  /// Metres: no point of the hull is farther from the mesh. 0 for a convex mesh. At most a quarter and 1 % of the
  /// hull's size more than the farthest point is; where that takes more than kHullExcessVisits, what these have left
  /// open.
  double distance = 0;
  double hull_volume = 0;  ///< m^3
  /// m^3: that the mesh encloses; NaN for one that has holes. Solids of one mesh that overlap count for each.
  double solid_volume = std::numeric_limits<double>::quiet_NaN();
};

/// Visits to nodes of its TriangleTree that one mesh gets: some twenty milliseconds.
inline constexpr int kHullExcessVisits = 1 << 17;

/// Measures it: 0 for a mesh that is proved convex; then a bound from the planes of its faces, which settles convex
/// meshes whose vertices were rounded; else by dividing space. The first two take time about linear in the mesh's size,
/// the third that of sorting it, and its visits.
///
/// A point is in the mesh if it lies within a closed part of it whose faces are counterclockwise seen from outside, or
/// all clockwise. A shell that is not closed has no inside. \param vertices of the mesh, finite. \param hull of the
/// vertices, and \param hull_faces a guess of its faces, outward; empty: its volume is not known. Nothing is measured
/// for a mesh without triangles.
HullExcess hull_excess(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, const Piece& hull,
                       std::span<const Triangle> hull_faces);

/// The same of a closed mesh whose faces' planes tell that it is convex, or nearly so: metres, rounding included, and 0
/// only where that is proved. None: they do not; it may be convex all the same. \param hull of all its vertices
std::optional<double> convex_excess(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                                    const Piece& hull);

}  // namespace clearance
