// The scenes that the sweep asks about, each in coherent motion.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/engine.h"

namespace clearance::tradeoff {

struct MovingScene {
  std::string name, what;  ///< what: one line for people
  Scene scene;
  std::vector<BodyPair> pairs;               ///< asked about
  std::vector<std::vector<BodyPose>> steps;  ///< poses of the moving bodies, step after step
};

/// near, far, touching, dense, fine, cell, extremes, spheres, capsules, boxes.
const std::vector<std::string>& scene_names();

/// The same for the same seed and number of steps. From one step to the next a body moves by about 1 % of its size and
/// turns by about half a degree, as between two control cycles.
/// \param folder of the repository's scenes. Throws std::invalid_argument for an unknown name, SceneError.
MovingScene make_moving_scene(const std::string& name, const std::string& folder, std::uint64_t seed, int steps);

}  // namespace clearance::tradeoff
