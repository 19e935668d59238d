// A scene with uncertain bodies: a robot on an uncertain cart, bodies that follow its links, bodies with uncertain
// rotation or old poses, prisms around cylinders, and bodies of several convex parts. Some bodies are certain.
#pragma once

#include <string>
#include <vector>

#include "engine/hull/shapes.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/cuda/same_answer.h"

namespace clearance::test {

/// A cylinder as in robots: the prism around it, with its excess as uncertainty.
inline void add_prism(engine::Scene& scene, const std::string& name, double radius, double length,
                      engine::Scene::BodyOptions options) {
  const Shape prism = make_cylinder(radius, length);
  Body body;
  body.name = name;
  body.parts.push_back(make_convex_part(prism.vertices));
  body.model_error = prism.model_error;
  body.is_static = options.is_static;
  body.pose = options.pose;
  if (!options.parent.empty()) body.parent = scene.find_body(options.parent);
  scene.add_body(std::move(body));
}

/// \param with_age some bodies have a max_speed, so their slack grows with time
inline engine::Scene uncertain_robot_scene(bool with_age) {
  Random random(31);
  engine::Scene scene;
  scene.add_sphere("cart", 0.2, {.pose = random.pose(0.3), .uncertainty = {0.01, 0.05}});
  engine::RobotOptions options = at_home();
  options.parent = "cart";
  scene.add_robot("arm", options);
  scene.add_hull("tool", cloud_on_sphere(40, 0.1, 3), {.parent = "arm/flange", .pose = random.pose(0.1)});
  add_prism(scene, "can", 0.15, 0.6, {.is_static = true, .pose = random.pose(0.6)});
  scene.add_hull("turned", cloud_on_sphere(150, 0.2, 5), {.pose = random.pose(0.6), .uncertainty = {0, 0.2}});
  scene.add_sphere("rider", 0.1, {.parent = "turned", .pose = random.pose(0.3)});
  scene.add_hull("known", cloud_on_sphere(60, 0.2, 7), {.pose = random.pose(0.6)});
  scene.add_box("known too", {0.3, 0.4, 0.2}, {.pose = random.pose(0.6)});
  for (const bool known : {false, true}) {
    Body body;
    body.name = known ? "known pieces" : "pieces";
    body.pose = random.pose(0.6);
    if (!known) body.uncertainty = {0.001, 0.01};
    for (int i = 0; i < 3; ++i) {
      std::vector<Vec3d> corners = random.cloud(14, {0.1, 0.1, 0.1});
      for (Vec3d& p : corners) p.x += 0.2 * i;
      body.parts.push_back(make_convex_part(std::move(corners), i == 1 ? 0.02 : 0));
    }
    scene.add_body(std::move(body));
  }
  scene.add_box("old", {0.2, 0.2, 0.3},
                {.pose = random.pose(0.6), .uncertainty = {0.003, 0}, .max_speed = with_age ? 0.01 : 0});
  return scene;
}

/// The robot's joints and some bodies move; all pairs except those of two fixed bodies.
struct UncertainCase {
  engine::Scene scene;
  std::vector<std::uint32_t> bodies, joints;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  std::vector<double> positions;
  QueryView q;

  UncertainCase(std::uint32_t configurations, std::uint64_t seed, bool with_age = false)
      : scene(uncertain_robot_scene(with_age)) {
    Random random(seed);
    for (const char* name : {"turned", "known", "known too", "pieces", "known pieces"})
      bodies.push_back(scene.find_body(name));
    for (std::uint32_t j = 0; j < scene.joints().size(); ++j)
      if (scene.joints()[j].name != "arm/joint2") joints.push_back(j);
    const auto is_shaped = [&](std::uint32_t b) { return !scene.bodies()[b].parts.empty(); };
    for (std::uint32_t a = 0; a < scene.bodies().size(); ++a)
      for (std::uint32_t b = a + 1; b < scene.bodies().size(); ++b)
        if (is_shaped(a) && is_shaped(b)) pairs.push_back(a % 2 ? BodyPair{a, b} : BodyPair{b, a});
    for (std::size_t i = 0; i < configurations * bodies.size(); ++i) poses.push_back(random.pose(0.8));
    for (std::uint32_t k = 0; k < configurations; ++k)
      for (const std::uint32_t j : joints) {
        const std::string& name = scene.joints()[j].name;
        positions.push_back(name == "arm/grip"     ? random.uniform(0, 0.04)
                            : name == "arm/joint4" ? random.uniform(-3, -0.1)
                            : name == "arm/joint6" ? random.uniform(0, 3.7)
                                                   : random.uniform(-1.7, 1.7));
      }
    q.all_pairs = false;
    q.fields = kAllFields | kFieldPairLower;
    q.configuration_count = configurations;
    point();
  }
  UncertainCase(const UncertainCase&) = delete;
  /// Call after changes.
  void point() {
    q.pairs = pairs;
    q.bodies = bodies;
    q.joints = joints;
    q.configurations = poses;
    q.positions = positions;
  }
};

}  // namespace clearance::test
