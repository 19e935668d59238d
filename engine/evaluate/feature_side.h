// One core of a pair whose features are searched.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "engine/evaluate/feature_pair.h"
#include "engine/evaluate/round_feature.h"

namespace clearance {

inline constexpr double kFeatureEpsilon = 0x1p-52;  ///< relative rounding of witness points

/// Nearest points of two hulls, in float64. Nothing if they overlap.
/// \param toward direction from a towards b: where the search begins
std::optional<WitnessPoints> nearest_points(std::span<const Vec3d> a, std::span<const Vec3d> b, const Vec3d& toward);

/// A placed core. World axes from the pair's origin, except where noted.
struct FeaturePair::Side {
  /// \param keeps_vertices whether `vertices` is needed
  Side(const ConvexPart& of, const PoseMatrix& placed, const Vec3d& origin, bool keeps_vertices)
      : part(of),
        pose(placed),
        shift(placed.t_w - origin),
        vertices(keeps_vertices ? placed_vertices(of, placed, origin) : std::vector<Vec3d>()) {}

  const ConvexPart& part;
  const PoseMatrix& pose;
  Vec3d shift;                  ///< of its body's origin
  std::vector<Vec3d> vertices;  ///< of a hull, placed
  RoundPatch patch{};           ///< of a round core: the one that is tried

  Vec3d outward() const { return pose.R_wb * Vec3d{0, 0, 1}; }  ///< of a half-space
  Vec3d foot(const Vec3d& p) const { return p - outward() * dot(outward(), p - shift); }
  /// The feature of a hull or half-space at its witness point.
  /// \param n unit, towards the other core
  Feature flat_feature(const Vec3d& n, const Vec3d& point, double tolerance, bool wants_interior) const;
  /// The vertex of a hull farthest along a direction.
  Vec3d farthest(const Vec3d& n) const;
  /// Distance over which a hull's other vertices stay behind its supporting plane, while that turns about the features.
  /// \param spanned orthonormal directions of the features
  double cone_radius(const Vec3d& n, const Vec3d& point, double distance, std::span<const Vec3d> spanned,
                     double tolerance) const;
  /// The same of a round core.
  Feature round_feature(const Vec3d& n, const Vec3d& point, double distance) const;
  /// The nearest point of a hull or half-space to a point, or one of the patch near it.
  Vec3d nearest(const Vec3d& point) const;
};

}  // namespace clearance
