// The oracle of non-convex bodies: exact distances of triangles and enclosed volumes, in integer arithmetic.
//
// Pairs of triangles are solved by the oracle of convex parts (exact_distance.h): doubles only skip pairs that are
// proved farther than one that was solved exactly. Containment is decided by winding numbers, from signs of integers.
// Shares no code with engine/bvh.
#pragma once

#include <span>

#include "engine/base/triangle.h"
#include "tests/oracle/exact/exact_distance.h"

namespace clearance::exact {

/// A body (metres, body frame), grown by a radius.
struct BodyView {
  std::span<const Vec3d> vertices;
  std::span<const Triangle> triangles;  ///< if empty, the body is the hull of the vertices
  bool is_solid = false;                ///< the body includes every point of a winding number other than 0
  double radius = 0;
};

/// Exact distance of two bodies. Bodies that share a point have `cores_overlap`, and no depth: the cores' distance is
/// 0. A direction, simplex and weights are those of the nearest triangles, with indices in BodyView::vertices. Throws
/// std::invalid_argument as the oracle of convex parts does.
Result exact_distance(const BodyView& a, const Pose& X_wa, const BodyView& b, const Pose& X_wb);

/// Winding number of the triangles of a posed body around a point of the world: +1 inside a mesh that is outward by the
/// right-hand rule. Throws std::invalid_argument for a point on a triangle's edge, or on a triangle.
int exact_winding_number(const BodyView& body, const Pose& X_wb, const Vec3d& p);

}  // namespace clearance::exact
