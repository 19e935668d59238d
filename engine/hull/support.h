// Support functions: the vertex of a convex part farthest along a direction.
//
// support() is a proved maximum over all vertices, by scan or by a direction table. Bounds are made from it.
#pragma once

#include <cstdint>

#include "engine/base/double_double.h"
#include "engine/hull/convex_part.h"

namespace clearance {

template <class T>
struct SupportPoint {
  std::uint32_t index = 0;
  T value{};  ///< n . v of that vertex
};

/// The vertex with the largest computed n . v, ties to the lowest index (scan). Every other vertex has an exact n . v
/// of at most `value` + 3 u |n| rho, u the unit roundoff of T: see docs/trust/bounds.md. n in the body's frame, of any
/// length.
///
/// For a core in closed form (primitive.h) the index is 0, since its one vertex is a point of it, not the farthest. A
/// half-space reaches to 0 along its own normal, (0, 0, z), and to +inf along any other direction; for a round core 3
/// becomes 5.
SupportPoint<double> support(const ConvexPart& part, const Vec3d& n);
SupportPoint<DoubleDouble> support(const ConvexPart& part, const Vec3<DoubleDouble>& n);
/// The value of support() for a direction of length about 1 that was converted to world axes and back: one within 2^-46
/// of a half-space's normal counts as the normal, which changes another body's support by 2^-46 of its size.
double reach_of_core(const ConvexPart& part, const Vec3d& n);

/// Parts of more vertices than this carry a DirectionTable.
inline constexpr std::size_t kTableFromVertices = 64;

}  // namespace clearance
