// Qhull's guess of a convex hull. Qhull merges facets, so vertices and edges may be missing: a guess, never a proof.
#pragma once

#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// Outward triangles of the hull of `points`, indices among them. Empty if Qhull finds none (flat or nearly flat sets).
std::vector<Triangle> qhull_triangles(std::span<const Vec3d> points);

}  // namespace clearance
