// From the vertices that were loaded to the vertices of a piece.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/piece.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// The vertices that span a convex hull, and a guess of its faces.
struct Hull {
  std::vector<Vec3d> vertices;  ///< distinct, in the order given
  std::vector<Triangle>
      triangles;  ///< a guess of the hull's faces, outward; empty for flat sets and where none was made
};

/// The hull of `vertices`: exact duplicates merged, and any other vertex left out only if it is proved to lie in a
/// tetrahedron of vertices that are kept or are themselves proved inside; where the proof fails, the vertex is kept.
///
/// Qhull guesses which vertices are needed; the proof is four exact orientation tests (orientation.h). Meshes of more
/// than kHullCheckVertices that are seen to be convex already are taken as they are. \param vertices finite, at least
/// one. \param triangles faces that join them, if there are any; indices among them. \param distinct the caller has
/// merged duplicates already; a few that are left do no harm.
Hull reduce_to_hull(std::span<const Vec3d> vertices, std::span<const Triangle> triangles = {}, bool distinct = false);

/// Meshes of more vertices are looked at for being convex before Qhull is asked.
inline constexpr std::size_t kHullCheckVertices = 5'000;
/// Qhull is not given more vertices than this; it would take longer than a robot cares to wait.
inline constexpr std::size_t kHullMaxVertices = 150'000;

/// Throws std::invalid_argument for no vertex, and for a coordinate that is not finite or too large.
void check_vertices(std::span<const Vec3d> vertices);

/// The convex piece spanned by `vertices` and grown by `radius`, of reduce_to_hull().
/// \param faces receives the guess of its faces, if not null.
/// \param loaded_vertices how many there were before duplicates were merged by the caller (`distinct`); 0: those given.
/// Throws std::invalid_argument as make_piece() does.
PiecePtr make_hull_piece(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, double radius,
                         std::uint64_t loaded_vertices = 0, bool distinct = false,
                         std::vector<Triangle>* faces = nullptr);

}  // namespace clearance
