// On which side of a plane a point lies: the sign of a determinant, certain.
#pragma once

#include "engine/base/vec.h"

namespace clearance {

/// Magnitudes of coordinates that orientation() is exact for. Then every coordinate is a multiple of 2^-252, and so are
/// all differences; no product of three of them underflows (multiples of 2^-756) or overflows.
inline constexpr double kMinOrientationCoordinate = 1e-60;
inline constexpr double kMaxOrientationCoordinate = 1e60;

/// Whether each coordinate is 0 or of a magnitude that orientation() is exact for.
bool orientation_applies(const Vec3d& v);

/// The sign of det[b - a, c - a, p - a]: 1 if p lies on the side of the plane a, b, c from which they are seen to turn
/// counterclockwise, -1 on the other, 0 on the plane. Exact if orientation_applies() to all four.
///
/// Three steps: float64 with the error bound of J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast
/// robust geometric predicates" (1997), sect. 4.3; double-double; and expansions, the same paper's sect. 2.
int orientation(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p);

}  // namespace clearance
