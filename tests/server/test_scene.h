// Scenes of the daemon's tests, created without files.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "engine/engine.h"

namespace clearance {

inline engine::Scene::BodyOptions at(double x, double y, double z) {
  engine::Scene::BodyOptions options;
  options.pose = Pose{{x, y, z}};
  return options;
}

/// 0 table (static), 1 cup, 2 link1, 3 link2 (no pose); group 0 is arm (2, 3).
inline engine::Scene small_scene() {
  engine::Scene scene;
  engine::Scene::BodyOptions table = at(0, 0, 0);
  table.is_static = true;
  scene.add_box("table", {2, 1, 0.1}, table);
  scene.add_sphere("cup", 0.1, at(0, 0, 0.3));
  scene.add_capsule("link1", 0.05, 0.4, at(0.5, 0, 0.5));
  scene.add_capsule("link2", 0.05, 0.4, {});
  const std::vector<std::string> arm{"link1", "link2"};
  scene.add_group("arm", arm);
  return scene;
}

/// `count` scattered bodies of 40 random vertices each, for queries that take a while.
inline engine::Scene scattered_scene(int count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  engine::Scene scene;
  for (int b = 0; b < count; ++b) {
    std::vector<Vec3d> vertices(40);
    for (Vec3d& v : vertices) v = {unit(random), unit(random), unit(random)};
    scene.add_hull("body" + std::to_string(b), vertices, at(20 * unit(random), 20 * unit(random), 20 * unit(random)));
  }
  return scene;
}

}  // namespace clearance
