// Convex parts as the oracle solves them.
#pragma once

#include <vector>

#include "engine/scene/scene_robot.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

/// Hulls that bound a convex part from outside and from inside, both grown by the radius: with a curved part or an
/// uncertain turn, they differ. The radius includes padding and the uncertainty of position. Metres, in the body's
/// frame.
struct PartBounds {
  std::vector<Vec3d> outer, inner;
  double radius = 0;
  double turn = 0;  ///< growth of `outer` alone
};

PartBounds hull_bounds(std::vector<Vec3d> vertices, double radius = 0);
PartBounds box_bounds(const Vec3d& size);
/// Along z; length between the centres of its caps.
PartBounds capsule_bounds(double radius, double length);
/// Along z: prisms around it and in it, each with a margin for its rounding.
PartBounds cylinder_bounds(double radius, double length);

PartBounds moved(PartBounds bounds, const Vec3d& by);
/// Bounds of a part with padding and an uncertain pose.
PartBounds grown(PartBounds bounds, double padding, const Uncertainty& uncertainty);

/// Points on an ellipsoid with these half axes, whose coordinates are multiples of 2^-10 m, so that sums are exact.
std::vector<Vec3d> random_points(Random& random, int count, const Vec3d& half);

}  // namespace clearance::exact
