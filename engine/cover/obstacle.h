// An obstacle, a convex part or a cloud, as the balls of a cover see it, in float32.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "engine/base/vec.h"
#include "engine/bvh/surface.h"
#include "engine/hull/convex_part.h"

namespace clearance {

/// Bounds on the distances of eight points from an obstacle, in metres. `low` is at most the distance plus
/// Obstacle::error. `high` is at least the distance less that error; if high + error is negative, a ball of radius
/// -(high + error) about the point lies in the obstacle.
struct PointGaps {
  alignas(32) float low[8], high[8];
};

/// A part of a body that does not move, in a frame common to a query's covers.
struct Obstacle {
  enum class Kind : std::uint8_t {
    kSegment,    ///< of a sphere or capsule: from -half[2] to half[2] along z
    kBox,        ///< half[0], half[1], half[2]; of a rectangle one is 0, of a segment along an axis two
    kCylinder,   ///< along z: radius half[0], half length half[2]
    kPlanes,     ///< a hull, cone or ellipsoid, between two polytopes
    kHalfSpace,  ///< z <= 0
    kCloud,      ///< boxes of half[0], half[1], half[2] about points, or points
  };
  Kind kind = Kind::kSegment;
  bool is_aligned = false;      ///< the axes are those of the common frame: `axes` is the identity
  std::array<float, 9> axes{};  ///< rows: a point c of the common frame is axes (c - at) in the obstacle's axes
  std::array<float, 3> at{}, half{};
  float radius = 0;  ///< by which the core is grown, metres
  float error = 0;   ///< metres; of PointGaps, for points up to the given reach from the frame's origin
  /// kPlanes, in the common frame: n . c <= outer for all points c of the core. A point with n . c <= inner for all n,
  /// as computed in float32, is in the core. |n| <= 1.
  std::vector<float> normal_x, normal_y, normal_z, outer, inner;
  /// kPlanes: the core holds the ball of inner_radius about `at`, and is held by that of outer_radius. If the former is
  /// 0, no point satisfies all planes, and `at` is a point of the core.
  float inner_radius = 0, outer_radius = 0;
  SurfacePtr cloud;  ///< kCloud: the points, relative to `at`
};

/// Shape of an obstacle in its part's frame, in float64. It is the same for all poses, so worth keeping with the part:
/// that of a hull takes tens of microseconds or more.
struct ObstacleShape {
  struct Plane {
    Vec3d normal;         ///< not longer than 1
    double outer, inner;  ///< heights of Obstacle, relative to the centre
  };
  Obstacle::Kind kind = Obstacle::Kind::kSegment;
  Mat3d axes = Mat3d::identity();  ///< rows: the axes of the obstacle
  Vec3d centre{0, 0, 0}, half{0, 0, 0};
  double radius = 0;
  double reach = 0, spread = 0;  ///< bounds on the distance of the core's points from the origin and from the centre
  std::vector<Plane> planes;
  SurfacePtr cloud;
};

/// The shape of a part, or nothing for a part with triangles and for one that reaches farther than 1e6 m.
std::optional<ObstacleShape> obstacle_shape(const ConvexPart& part);

/// The obstacle for a shape, or nothing if a number is not finite, `reach` above 1e4 m or the translation longer than
/// 1e6 m.
/// \param rotation of the part's frame in the common frame, within 2^-47 of a rotation (Frobenius norm)
/// \param translation likewise, within 2^-47 of its length; a greater error must be added to Obstacle::error
/// \param reach bound on the distance from the common frame's origin of the points for which gaps are computed, metres
std::optional<Obstacle> make_obstacle(const ObstacleShape& shape, const Mat3d& rotation, const Vec3d& translation,
                                      double reach);

/// The same for a part.
std::optional<Obstacle> make_obstacle(const ConvexPart& part, const Mat3d& rotation, const Vec3d& translation,
                                      double reach);

}  // namespace clearance
