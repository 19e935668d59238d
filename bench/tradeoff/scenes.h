// The scenes of the sweep, each in coherent motion.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/engine.h"

namespace clearance::tradeoff {

struct MovingScene {
  std::string name, what;  ///< what: a one-line description
  engine::Scene scene;
  std::vector<BodyPair> pairs;               ///< pairs of the queries
  std::vector<std::vector<BodyPose>> steps;  ///< poses of the moving bodies, step by step
};

/// near, far, touching, dense, fine, cell, extremes, spheres, capsules, boxes.
const std::vector<std::string>& scene_names();

/// Deterministic for a seed and number of steps. In each step a body moves by about 1 % of its size and rotates by
/// about half a degree, as between two control cycles. Throws std::invalid_argument for an unknown name, and
/// SceneError.
/// \param folder of the repository's scenes
MovingScene make_moving_scene(const std::string& name, const std::string& folder, std::uint64_t seed, int steps);

}  // namespace clearance::tradeoff
