// Computes the vertices of a convex part from those loaded.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/convex_part.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// The vertices that span a convex hull, and a guess of its faces.
struct Hull {
  std::vector<Vec3d> vertices;      ///< distinct, in the order given
  std::vector<Triangle> triangles;  ///< a guess of the hull's faces, outward; empty for flat sets and without a guess
};

/// The hull of `vertices`. Exact duplicates are merged. Any other vertex is left out only if it is proved to lie in a
/// tetrahedron of vertices that are kept or are themselves proved inside; without a proof it is kept.
///
/// Qhull guesses which vertices are needed; the proof is four exact orientation tests (orientation.h). Meshes of more
/// than kHullCheckVertices that are found to be convex already are kept unchanged.
/// \param vertices finite, at least one
/// \param triangles faces that join them, or none; indices among them
/// \param distinct the caller has merged duplicates already; a few remaining ones do no harm
Hull reduce_to_hull(std::span<const Vec3d> vertices, std::span<const Triangle> triangles = {}, bool distinct = false);

/// Meshes of more vertices are tested for convexity before Qhull runs.
inline constexpr std::size_t kHullCheckVertices = 5'000;
/// Maximum number of vertices for Qhull; more would take too long.
inline constexpr std::size_t kHullMaxVertices = 150'000;

/// Throws std::invalid_argument without vertices, and for a coordinate that is not finite or too large.
void check_vertices(std::span<const Vec3d> vertices);

/// The convex part spanned by `vertices` and grown by `radius`, from reduce_to_hull(). Throws std::invalid_argument as
/// make_convex_part() does.
/// \param faces receives the guess of its faces, if not null
/// \param loaded_vertices their number before the caller merged duplicates (`distinct`), or 0 for those given
ConvexPartPtr make_hull_part(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, double radius,
                             std::uint64_t loaded_vertices = 0, bool distinct = false,
                             std::vector<Triangle>* faces = nullptr);

}  // namespace clearance
