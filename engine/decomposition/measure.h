// Distances of points to convex parts and to the triangles of a mesh, with the certified bounds of narrow_phase().
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "engine/bvh/surface.h"
#include "engine/hull/convex_part.h"
#include "engine/pose/placed.h"

namespace clearance {

class Measure {
 public:
  struct Bounds {
    double lower, upper;  ///< metres, lower >= 0
    Vec3d away;           ///< unit: the direction from the part to the point that proves `lower`
  };
  /// \param fine bounds no farther apart than this are not refined, metres
  explicit Measure(double fine) : fine_(fine) {}

  /// Distance of a point from a convex set, both in the same frame.
  /// \param part its radius counts, too
  Bounds to(const ConvexPart& part, const Vec3d& p);
  /// Distance of a point from the hull of a few points.
  Bounds to(std::span<const Vec3d> corners, const Vec3d& p);
  /// Lower bound on the distance of a part from the hull of a few points; not below 0.
  double apart(std::span<const Vec3d> corners, const ConvexPart& part);
  /// Lower bound on the signed distance of two hulls of a few points, as far as it is proved.
  double gap(std::span<const Vec3d> a, std::span<const Vec3d> b);
  /// Number of distances computed.
  std::uint64_t count() const { return count_; }

 private:
  Bounds evaluate(const ConvexPart& a, const ConvexPart& b);

  double fine_;
  std::uint64_t count_ = 0;
  ConvexPart parts_[2];
};

/// The triangle of a mesh that is nearest to a point, as computed.
std::uint32_t nearest_triangle(const Surface& surface, const Vec3d& p);

/// Finds all triangles in leaves whose boxes meet a box. Returns false if there are more than `most`.
bool triangles_that_meet(const Surface& surface, const Vec3d& low, const Vec3d& high, std::size_t most,
                         std::vector<std::uint32_t>& found);

/// Bound on the rounding of a point that divides an edge between points no farther than `reach` from the origin
/// (docs/bounds_bodies.md, "Decompositions").
inline double rounding_of_division(double reach) {
  return 0x1p-49 * reach + std::numeric_limits<double>::min();
}

}  // namespace clearance
