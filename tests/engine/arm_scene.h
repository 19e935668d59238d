// The tests' arm (tests/engine/robot/arm.urdf) in a small scene.
#pragma once

#include <string>
#include <vector>

#include "engine/engine.h"
#include "tests/source_file.h"

namespace clearance::test {

inline const std::string kArm = source_file("tests/engine/robot/arm.urdf");

inline engine::Scene arm_scene(const engine::RobotOptions& options) {
  engine::Scene scene;
  scene.add_box("table", {1, 1, 0.1}, {.is_static = true, .pose = Pose{{0.5, 0, -0.1}}});
  scene.add_sphere("ball", 0.1, {.pose = Pose{{0.4, 0.3, 0.5}}});
  scene.add_robot("arm", options);
  return scene;
}

inline engine::RobotOptions at_home() {
  engine::RobotOptions options;
  options.urdf = kArm;
  options.home = {{"joint4", -1.5}};
  return options;
}

inline std::vector<std::uint32_t> joints_of(const engine::Scene& scene, const std::string& group) {
  for (const JointGroup& g : scene.joint_groups())
    if (g.name == group) return g.joints;
  return {};
}

}  // namespace clearance::test
