// Distance by which the hull of a mesh exceeds the mesh: the error of one convex part for a concave body.
#pragma once

#include <limits>
#include <optional>
#include <span>

#include "engine/base/vec.h"
#include "engine/hull/convex_part.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// Excess of a hull over the mesh whose vertices span it.
struct HullExcess {
  /// Bound on the distance of the hull's points from the mesh, in metres; 0 for a convex mesh. It exceeds the distance
  /// of the farthest point by at most a quarter and 1 % of the hull's size, or by more if that takes more than
  /// kHullExcessVisits.
  double distance = 0;
  double hull_volume = 0;  ///< m^3
  /// m^3, enclosed by the mesh; NaN if it has holes. Overlapping solids of one mesh each count.
  double solid_volume = std::numeric_limits<double>::quiet_NaN();
};

/// Maximum visits to nodes of its TriangleTree for one mesh: some twenty milliseconds.
inline constexpr int kHullExcessVisits = 1 << 17;

/// Measures the excess. Returns 0 for a mesh that is proved convex; otherwise tries a bound from the planes of its
/// faces, which suffices for convex meshes with rounded vertices; otherwise divides space. The first two take time
/// about linear in the mesh's size, the third that of sorting it, and its visits.
///
/// A point is in the mesh if it lies within a closed component of it whose faces are counterclockwise seen from
/// outside, or all clockwise. A shell that is not closed has no inside. Nothing is measured for a mesh without
/// triangles.
/// \param vertices of the mesh, finite
/// \param hull of the vertices
/// \param hull_faces a guess of its faces, outward; if empty, its volume is unknown
HullExcess hull_excess(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, const ConvexPart& hull,
                       std::span<const Triangle> hull_faces);

/// The same for a closed mesh whose faces' planes prove that it is convex, or nearly so: metres, rounding included, and
/// 0 only if it is proved convex. Nothing without a proof; it may be convex all the same.
/// \param hull of all its vertices
std::optional<double> convex_excess(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                                    const ConvexPart& hull);

}  // namespace clearance
