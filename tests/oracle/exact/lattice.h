// Bodies of integer lattices with rational rotations: float64 represents their vertices in the world exactly.
#pragma once

#include <vector>

#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

/// A rotation whose matrix is integers over n, and n.
Pose lattice_rotation(Random& random, int* n);

/// Points of an integer lattice; all coordinates are multiples of `step`.
std::vector<Vec3d> lattice_points(Random& random, int range, int step);

/// Vertices, multiples of n, rotated by a matrix of integers over n.
std::vector<Vec3d> in_world(const Solid& s, const Pose& X, int n);

/// Centroid of some of the vertices that are extreme along n; exact, since coordinates are multiples of 12.
Vec3d extreme_point(Random& random, const std::vector<Vec3d>& v, Vec3d n);

}  // namespace clearance::exact
