// A convex obstacle as the balls of a cover see it, in float32.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/convex_part.h"

namespace clearance {

/// Bounds on the distances of eight points from an obstacle, in metres. `low` is at most the distance plus
/// Obstacle::error. `high` is at least the distance less that error; if it is negative, a ball of radius
/// -(high + error) about the point lies in the obstacle.
struct PointGaps {
  alignas(32) float low[8], high[8];
};

/// A part of a body that does not move, in a frame common to a query's covers.
struct Obstacle {
  enum class Kind : std::uint8_t {
    kSegment,    ///< of a sphere or capsule: from -half[2] to half[2] along z
    kBox,        ///< half[0], half[1], half[2]
    kCylinder,   ///< along z: radius half[0], half length half[2]
    kPlanes,     ///< a hull by its planes
    kHalfSpace,  ///< z <= 0
  };
  Kind kind = Kind::kSegment;
  bool is_aligned = false;           ///< the axes are those of the common frame: `axes` is the identity
  std::array<float, 9> axes{};       ///< rows: a point c of the common frame is axes (c - at) in the obstacle's axes
  std::array<float, 3> at{}, half{};
  float radius = 0;                  ///< by which the core is grown, metres
  float error = 0;                   ///< metres; of PointGaps, for points up to the given reach from the frame's origin
  // kPlanes: n . c <= height holds for the points of the core, in the common frame.
  std::vector<float> normal_x, normal_y, normal_z, height;
  bool planes_are_all = false;       ///< a point that satisfies all of them is in the core
  std::array<float, 3> inner_centre{};
  float inner_radius = 0;            ///< a ball that the core holds
};

/// The obstacle for a part, or nothing for a part with a surface, a cone or an ellipsoid.
/// \param rotation, translation of the part's frame in the common frame; accurate to a few roundings of float64
/// \param reach bound on the distance from the common frame's origin of the points for which gaps are computed, metres
std::optional<Obstacle> make_obstacle(const ConvexPart& part, const Mat3d& rotation, const Vec3d& translation,
                                      double reach);

}  // namespace clearance
