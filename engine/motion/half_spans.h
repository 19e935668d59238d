// How near two bodies can come within half a span, by how fast they move at its middle: docs/bounds.md, "Motion".
#pragma once

#include "engine/hull/box.h"
#include "engine/motion/motion_step.h"
#include "engine/pose/placed.h"
#include "engine/robot/link_twists.h"
#include "engine/scene/scene.h"

namespace clearance {

/// A body in the middle of a span, with how fast it moves before whoever sees the pair.
struct MovingBody {
  const Body& body;
  const PoseMatrix& pose;
  Twist twist;                   ///< world axes
  const Aabb* box = nullptr;     ///< looked at in place of the pieces that it holds; world axes
  const Piece* piece = nullptr;  ///< looked at in place of all pieces
};

/// Along one direction, which the seer carries with him. \param normal world axes, from a to b, about of length 1.
/// \param half of the span. \param bend metres: what the points of both are accelerated by makes so much until the ends
HalfSpans gaps_along(const Vec3d& normal, const MovingBody& a, const MovingBody& b, double half, double bend);

}  // namespace clearance
