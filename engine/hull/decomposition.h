// Convex parts in place of a non-convex body, with bounds on their deviation.
#pragma once

#include <vector>

#include "engine/hull/convex_part.h"

namespace clearance {

/// Convex parts P for exact geometry T, a surface or a solid, before both are grown by a radius (docs/bounds_bodies.md,
/// "Decompositions"). Metres, in the body's frame.
struct Decomposition {
  std::vector<ConvexPartPtr> parts;  ///< at least one; radius 0
  double inner = 0;                  ///< bound on the distance of T's triangles from P
  std::vector<double> outer;         ///< for each part, a bound on the distance of its points from T
  double most_outer() const {
    double most = 0;
    for (const double o : outer) most = most < o ? o : most;
    return most;
  }
};

}  // namespace clearance
