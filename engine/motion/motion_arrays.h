// Bounds on motion as plain arrays, for kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/robot/motion_path_step.h"

namespace clearance {

/// The joints that move some points relative to an observer: a range of the query's movers, whose columns are indices
/// into a row of its positions.
struct MotionChain {
  std::uint32_t first = 0, count = 0;            ///< movers; empty if the points do not move
  std::uint32_t robot = 0;                       ///< index in Plan::motions, whose travel counts
  double error_fixed = 0, error_per_travel = 0;  ///< PlacementError of the points as placed
};
/// Views of a pair from several observers; the bounds of each view hold.
struct MotionViews {
  struct View {
    std::uint32_t a, b;  ///< chains; kNone if the body does not move
    std::uint32_t seer;  ///< index among the moved bodies; kNone if the observer does not move
  };
  View view[3];
  std::uint32_t count;
};

/// MotionBounds of a query in which only joints move bodies.
struct MotionArrays {
  std::vector<Mover> movers;
  std::vector<MotionChain> chains;
  std::vector<std::uint32_t> chain_of_slot;  ///< (moved,) relative to the world; kNone if nothing moves the body
  std::vector<MotionViews> views;
  std::vector<std::uint32_t> views_of_pair;  ///< (pairs,); kNone if both bodies are observed from the world
  std::vector<double> reach;                 ///< (bodies,) metres: bound on the points' distance from the origin
};

}  // namespace clearance
