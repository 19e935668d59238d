// Seeded directions and rotations for scenes of tests and measurements.
#pragma once

#include <cmath>

#include "engine/hull/shapes.h"
#include "engine/pose/pose.h"

namespace clearance {

/// A unit vector, evenly distributed.
inline Vec3d direction(PortableRandom& random) {
  while (true) {
    const Vec3d v{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    const double length = norm(v);
    if (length > 0.1 && length <= 1) return v * (1 / length);
  }
}

/// A rotation by `angle` rad about a unit axis through the origin.
inline Pose turn(const Vec3d& axis, double angle) {
  const double s = std::sin(angle / 2);
  return {{0, 0, 0}, std::cos(angle / 2), axis.x * s, axis.y * s, axis.z * s};
}

}  // namespace clearance
