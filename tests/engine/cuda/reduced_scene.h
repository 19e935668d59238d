// Scenes for tests of the device's reductions.
#pragma once

#include <string>

#include "tests/engine/cuda/same_answer.h"

namespace clearance::test {

inline constexpr Reduce kReductions[] = {Reduce::kNearest, Reduce::kMin, Reduce::kWithin};

/// Bodies that the device supports: few shapes, some rounded, some static.
inline engine::Scene simple_scene(int count, double box, std::uint64_t seed) {
  Random random(seed);
  engine::Scene scene;
  for (int i = 0; i < count; ++i) {
    engine::Scene::BodyOptions options;
    options.pose = random.pose(box);
    options.is_static = i % 7 == 3;
    const std::string name = "body" + std::to_string(i);
    switch (i % 4) {
      case 0:
        scene.add_capsule(name, 0.2, 0.5, options);
        break;
      case 1:
        scene.add_hull(name, cloud_on_sphere(200, 0.5, 4), options);
        break;
      case 2:
        scene.add_box(name, {0.4, 0.7, 0.2}, options);
        break;
      default:
        scene.add_uv_sphere(name, 0.5, 5, options);
    }
  }
  return scene;
}

}  // namespace clearance::test
