// RRT-Connect (Kuffner, LaValle 2000) whose every edge is proved free.
#pragma once

#include <clearance/edge_prover.h>
#include <clearance/query.h>
#include <clearance/scene_info.h>

#include <cstdint>
#include <span>
#include <vector>

namespace clearance {

struct PlanOptions {
  /// Greatest length of a new edge, Euclidean in joint space, in radians and metres.
  double range = 1.0;
  /// Samples after which the planner gives up.
  std::uint64_t max_iterations = 100'000;
  /// Random shortcuts that are tried on the path found. 0 leaves it as the trees have it.
  std::uint32_t shortcuts = 32;
  /// Selects the samples and the shortcuts. The same seed and the same verdicts give the same path.
  std::uint64_t seed = 0;
};

/// A path, and the effort of the search.
struct PathFound {
  std::vector<double> path;      ///< (N, J); empty if no path was found
  std::uint64_t iterations = 0;  ///< samples drawn
  std::uint64_t edges = 0;       ///< motions that were tried
};

/// Searches for a path whose every motion is proved free. The caller has checked that both states are free and within
/// the limits.
///
/// Half of the samples are uniform within the limits, half near the straight motion from start to goal. Uniform samples of
/// a joint without limits are from -pi to pi, of one with a single limit to 2 pi from there. Joints do not wrap around.
/// \param limits (J,) of the joints
/// \param start, goal (J,) radians and metres
CLEARANCE_API PathFound find_path(EdgeProver& prover, std::span<const JointLimits> limits,
                                  std::span<const double> start, std::span<const double> goal,
                                  const PlanOptions& options);

}  // namespace clearance
