// The oracle: exact signed distance of two posed convex parts, in integer arithmetic (GMP).
//
// Input doubles are taken as exact rationals; a pose is the exact rotation M(q) / |q|^2 and the exact translation.
// Nothing is rounded before the very end, where a value sign * sqrt(p / q) - r is compared with doubles, again exactly.
// Shares no code with the engine except the types Vec3 and Pose.
#pragma once

#include <gmpxx.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/pose/pose.h"

namespace clearance::exact {

using Vec3z = Vec3<mpz_class>;

/// The convex hull of the vertices (metres, body frame), grown by a radius.
struct ConvexPartView {
  std::span<const Vec3d> vertices;
  double radius = 0;
};

/// The real number sign * sqrt(numerator / denominator) - radius, in metres.
struct Value {
  int sign = 0;  ///< -1, 0 or 1, of the core's signed distance
  mpz_class numerator = 0, denominator = 1;
  mpq_class radius = 0;

  /// The sign of (this value - x), decided exactly.
  int compare(double x) const;
  /// The same for another value; both radii must be equal.
  int compare(const Value& other) const;
  /// The largest double that is not above this value. For every double x, `x <= value` and `x <= lower()` are
  /// equivalent.
  double lower() const;
  /// The smallest double that is not below this value.
  double upper() const;
};

/// One vertex of the difference B - A: a vertex of each part.
struct VertexPair {
  std::uint32_t a = 0, b = 0;
};

struct Result {
  Value distance;              ///< signed distance of the grown parts; without depth, of overlapping cores: 0 - radii
  bool cores_overlap = false;  ///< the cores (parts without their radius) share a point
  /// Direction that proves the value, from a towards b, not normalised: gap(direction) / |direction| is the core's
  /// distance. Zero if the cores overlap and depth was not requested.
  Vec3z direction{0, 0, 0};
  /// For separated cores: the vertices whose hull contains the nearest points, with weights > 0 (divide by their sum).
  /// For overlapping cores: vertices of the nearest facet of B - A (none if the difference is flat), without weights.
  std::vector<VertexPair> simplex;
  std::vector<mpz_class> weights;
  int iterations = 0;  ///< exact steps taken, of both stages
};

/// Exact signed distance of two parts. Throws std::invalid_argument for a part without vertices, a non-finite number or
/// a zero quaternion.
/// \param depth also solve for the penetration depth if the cores overlap
Result exact_distance(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb,
                      bool depth = true);

/// The exact support gap of direction n (world frame, from a towards b, need not be a unit vector): [min_b n.b - max_a
/// n.a] / |n| - r_a - r_b, a lower bound of the signed distance. Throws for n = 0 or non-finite.
Value exact_support_gap(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb,
                        const Vec3d& n);
/// The same for a direction of integers.
Value exact_gap_along(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb,
                      const Vec3z& n);

/// Guesses in doubles: vertices under a pose and a shift, and an approximate separating direction from points a towards
/// points b, not of length 1; zero if they seem to overlap.
std::vector<Vec3d> roughly_placed(std::span<const Vec3d> vertices, const Pose& X, const Vec3d& shift);
Vec3d rough_direction(std::span<const Vec3d> a, std::span<const Vec3d> b);

}  // namespace clearance::exact
