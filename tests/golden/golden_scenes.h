// Scenes whose answers are kept bit for bit. Their numbers come from integers, divisions and square roots alone: no
// mesh, no Qhull, no function of a mathematical library, so that every machine makes the same ones.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/scene.h"

namespace clearance::golden {

struct GoldenScene {
  std::string name;
  Scene scene;
  std::vector<std::uint32_t> moved;  ///< bodies that configurations place
  std::vector<Pose> configurations,
      next;            ///< (kConfigurations, moved); `next`: each a little farther on, for warm starts
  double cut_off = 1;  ///< metres; some pairs are nearer, some are farther
};
inline constexpr std::uint32_t kConfigurations = 5;

/// All of them, in the order of answers.csv.
std::vector<GoldenScene> golden_scenes();

}  // namespace clearance::golden
