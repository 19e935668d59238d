// Bounds on motion as plain arrays, for kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/robot/motion_path_step.h"

namespace clearance {

/// The joints that move some points before somebody's eyes: some of the query's movers, whose columns are places in a
/// row of its positions.
struct MotionChain {
  std::uint32_t first = 0, count = 0;            ///< movers; none: it stands still there
  std::uint32_t robot = 0;                       ///< of Plan::motions, whose travel counts
  double error_fixed = 0, error_per_travel = 0;  ///< PlacementError of the points as placed
};
/// How a pair looks to some seers: of these views each bound holds.
struct MotionViews {
  struct View {
    std::uint32_t a, b;  ///< chains; kNone: it stands still there
    std::uint32_t seer;  ///< place among the moved; kNone: nothing moves him
  };
  View view[3];
  std::uint32_t count;
};

/// What MotionBounds knows of a query whose joints alone move bodies.
struct MotionArrays {
  std::vector<Mover> movers;
  std::vector<MotionChain> chains;
  std::vector<std::uint32_t> chain_of_slot;  ///< (moved,) from the world; kNone: nothing moves it
  std::vector<MotionViews> views;
  std::vector<std::uint32_t> views_of_pair;  ///< (pairs,); kNone: both are seen from the world
  std::vector<double> reach;                 ///< (bodies,) metres: no point of a body is farther from its origin
};

}  // namespace clearance
