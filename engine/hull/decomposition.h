// Convex pieces in place of a body that is not convex, and how far they may miss it.
#pragma once

#include <vector>

#include "engine/hull/piece.h"

namespace clearance {

/// Pieces P for a truth T, a surface or a solid, before both are grown by a radius (docs/bounds.md, "Decompositions").
/// Metres, in the body's frame.
struct Decomposition {
  std::vector<PiecePtr> pieces;  ///< at least one; radius 0
  double inner = 0;              ///< no point of T's triangles is farther from P
  std::vector<double> outer;     ///< of each piece: no point of it is farther from T
  double most_outer() const {
    double most = 0;
    for (const double o : outer) most = most < o ? o : most;
    return most;
  }
};

}  // namespace clearance
