// The tests' arm in a crowded scene, with and without covers.
#pragma once

#include <chrono>
#include <cmath>
#include <string>
#include <vector>

#include "engine/hull/shapes.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {

inline constexpr std::chrono::minutes kCoversPatience{10};

/// A mesh of two boxes that overlap.
inline Shape step_mesh() {
  Shape step = make_box({0.3, 0.3, 0.1});
  const Shape upper = make_box({0.1, 0.3, 0.3});
  const auto first = static_cast<std::uint32_t>(step.vertices.size());
  for (const Vec3d& v : upper.vertices) step.vertices.push_back(v + Vec3d{0.1, 0, 0.15});
  for (const auto& t : upper.triangles) step.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return step;
}

/// Points of a box's surface.
inline std::vector<CloudPoint> scanned_box(const Vec3d& centre, const Vec3d& half, int count, Random& random) {
  std::vector<CloudPoint> points;
  for (int i = 0; i < count; ++i) {
    CloudPoint p;
    const int flat = static_cast<int>(random.below(3));
    for (int k = 0; k < 3; ++k) {
      const double along = k == flat ? std::copysign(1, random.uniform(-1, 1)) : random.uniform(-1, 1);
      p[static_cast<std::size_t>(k)] = static_cast<float>(centre[k] + half[k] * along);
    }
    points.push_back(p);
  }
  return points;
}

/// The arm among one obstacle of each kind. It holds a box, and a link of it is padded.
/// \param with_surfaces false for single convex parts alone, without the mesh and the clouds
/// \param with_held false without the box that it holds
inline engine::Scene crowded_scene(bool with_surfaces = true, bool with_held = true) {
  engine::RobotOptions arm = at_home();
  arm.link_padding = {{"fore", 0.01}};
  engine::Scene scene = arm_scene(arm);
  scene.add_half_space("floor", {.pose = Pose{{0, 0, -0.4}}});
  const auto still = [](Vec3d at, double angle) {
    return engine::Scene::BodyOptions{.is_static = true,
                                      .pose = Pose{at, std::cos(angle / 2), 0, std::sin(angle / 2), 0}};
  };
  scene.add_capsule("rod", 0.05, 0.6, still({-0.4, 0.3, 0.4}, 0.7));
  scene.add_cylinder("post", 0.08, 0.8, still({0.3, -0.5, 0.4}, 0));
  scene.add_cone("cone", 0.1, 0.3, still({-0.3, -0.4, 0.3}, 0.2));
  Random random(11);
  scene.add_hull("rock", random.cloud(30, {0.2, 0.1, 0.15}), still({0.1, 0.6, 0.6}, 1.1));
  if (with_surfaces) {
    const Shape step = step_mesh();
    scene.add_mesh("step", step.vertices, step.triangles, MeshAs::kSolid, still({-0.1, -0.7, 0.5}, 0.4));
    scene.add_points("scan", scanned_box({0.5, 0.4, 0.3}, {0.06, 0.1, 0.12}, 3000, random), 0,
                     still({0, 0.1, 0.1}, 0.3));
    scene.add_points("voxels", scanned_box({-0.6, -0.2, 0.7}, {0.08, 0.06, 0.06}, 500, random), 0.02,
                     still({0, 0, 0}, 0));
  }
  if (with_held) scene.add_box("held", {0.05, 0.04, 0.2}, {.parent = "arm/palm", .pose = Pose{{0, 0, 0.1}}});
  // Neighbours overlap in every state.
  std::vector<std::string> chain = {"arm/base",   "arm/upper",       "arm/fore",         "arm/wrist", "arm/palm",
                                    "arm/flange", "arm/left_finger", "arm/right_finger", "held"};
  if (!with_held) chain.pop_back();
  for (std::size_t a = 0; a < chain.size(); ++a)
    for (std::size_t b = a + 1; b < chain.size() && (b <= a + 2 || a >= 3); ++b) scene.ignore(chain[a], chain[b]);
  return scene;
}

/// The same scene with and without covers.
struct CoverEngines {
  engine::Engine with{crowded_scene(), {.backend = "cpu", .threads = 2}};
  engine::Engine without{crowded_scene(), {.backend = "cpu", .threads = 2, .covers = engine::Covers::kOff}};
};

/// States of the arm, anywhere within its limits.
struct ArmStates {
  std::vector<std::uint32_t> joints;
  std::vector<double> positions;
  QueryView query;

  ArmStates(const engine::Scene& scene, int count) : joints(joints_of(scene, "arm")) {
    Random random(5);
    for (int i = 0; i < count; ++i)
      for (const std::uint32_t j : joints)
        positions.push_back(random.uniform(scene.joints()[j].lower, scene.joints()[j].upper));
    query.joints = joints;
    query.positions = positions;
    query.configuration_count = static_cast<std::uint32_t>(count);
    query.reduce = Reduce::kAny;
    query.fields = kAllFields & ~kFieldGradient;
  }
};

}  // namespace clearance::test
