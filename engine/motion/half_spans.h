// Bounds on the distance of two bodies within half a span, from their velocities at its middle:
// docs/trust/bounds_robots.md, "Motion".
#pragma once

#include "engine/hull/box.h"
#include "engine/motion/motion_step.h"
#include "engine/pose/placed.h"
#include "engine/robot/link_twists.h"
#include "engine/scene/scene.h"

namespace clearance {

/// A body in the middle of a span, with its velocity relative to the reference body of the pair.
struct MovingBody {
  const Body& body;
  const PoseMatrix& pose;
  Twist twist;                       ///< world axes
  const Aabb* box = nullptr;         ///< replaces the parts that it encloses; world axes
  const ConvexPart* part = nullptr;  ///< replaces all parts of the body
};

/// Bounds along one direction that is fixed to the reference body.
/// \param normal world axes, from a to b, length about 1
/// \param half half of the span
/// \param bend bend_of_pair(), in metres
HalfSpans gaps_along(const Vec3d& normal, const MovingBody& a, const MovingBody& b, double half, double bend);

}  // namespace clearance
