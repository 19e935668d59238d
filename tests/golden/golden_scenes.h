// Scenes whose answers are recorded bit for bit. Their numbers result from integers, divisions and square roots alone:
// no mesh, no Qhull, no mathematical library, so that they are the same on every machine.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/scene.h"

namespace clearance::golden {

struct GoldenScene {
  std::string name;
  engine::Scene scene;
  std::vector<std::uint32_t> moved;  ///< bodies that configurations place
  std::vector<Pose> configurations,
      next;            ///< (kConfigurations, moved); `next` is slightly displaced
  double cut_off = 1;  ///< in metres; some pairs are nearer, some farther
};
inline constexpr std::uint32_t kConfigurations = 5;

/// All of them, in the order of answers.csv.
std::vector<GoldenScene> golden_scenes();

}  // namespace clearance::golden
