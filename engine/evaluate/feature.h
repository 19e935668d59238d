// Features of convex parts: what of a core meets its supporting plane.
#pragma once

#include <span>
#include <vector>

#include "engine/hull/convex_part.h"
#include "engine/pose/placed.h"

namespace clearance {

/// A vertex, an edge or a face of a hull, the plane of a half-space, or a smooth part of a curved surface around a point.
/// World axes, metres from the pair's origin.
struct Feature {
  int size = 0;        ///< number of tangents: 0 vertex, 1 edge, 2 face
  Vec3d tangent[2]{};  ///< unit, normal to each other
  /// How fast the feature bends away from the other one, by both tangents: 0 0, 0 1, 1 1. Per metre, 0 if flat.
  double bend[3]{};
  /// Distance of the witness point from the feature's boundary, at most 0 on it; +inf without one.
  double interior = __builtin_inf();
};

/// The vertices of a part's core in world axes, from the pair's origin; none for a half-space.
std::vector<Vec3d> placed_vertices(const ConvexPart& part, const PoseMatrix& pose, const Vec3d& origin);

/// The feature spanned by the vertices that reach a supporting plane within a tolerance.
/// All in the same axes.
/// \param outward unit normal of that plane
/// \param point of the core, on the plane: the witness point
/// \param wants_interior whether Feature::interior of a face is needed
Feature feature_at(std::span<const Vec3d> vertices, const Vec3d& outward, const Vec3d& point, double tolerance,
                   bool wants_interior);

/// The plane with this normal.
Feature plane_feature(const Vec3d& normal);

}  // namespace clearance
