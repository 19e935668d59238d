// Small scenes for engine tests.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/engine/evaluate_query.h"

namespace clearance::test {

class Random {
 public:
  explicit Random(std::uint64_t seed) : bits_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(bits_); }
  double normal() { return normal_(bits_); }
  std::uint64_t below(std::uint64_t n) { return bits_() % n; }
  Pose pose(double box) {
    return {{uniform(-box, box), uniform(-box, box), uniform(-box, box)}, normal(), normal(), normal(), normal()};
  }
  std::vector<Vec3d> cloud(int count, Vec3d size) {
    std::vector<Vec3d> v;
    for (int i = 0; i < count; ++i) v.push_back({size.x * normal(), size.y * normal(), size.z * normal()});
    return v;
  }

 private:
  std::mt19937_64 bits_;
  std::normal_distribution<double> normal_;
};

/// Boxes, point clouds, spheres, capsules and bodies of two convex parts at random poses; every fifth body is static.
inline engine::Scene mixed_scene(int count, double box, std::uint64_t seed) {
  Random random(seed);
  engine::Scene scene;
  for (int i = 0; i < count; ++i) {
    engine::Scene::BodyOptions options;
    options.pose = random.pose(box);
    options.is_static = i % 5 == 4;
    const std::string name = "body" + std::to_string(i);
    switch (i % 4) {
      case 0:
        scene.add_box(name, {random.uniform(0.2, 1), random.uniform(0.2, 1), random.uniform(0.2, 1)}, options);
        break;
      case 1:
        scene.add_hull(name, random.cloud(20, {0.3, 0.3, 0.3}), options);
        break;
      case 2:
        scene.add_capsule(name, 0.2, 0.5, options);
        break;
      default: {
        Body body;
        body.name = name;
        body.pose = options.pose;
        body.is_static = options.is_static;
        std::vector<Vec3d> far = random.cloud(12, {0.2, 0.2, 0.2});
        for (Vec3d& v : far) v.x += 1.5;
        body.parts = {make_convex_part(random.cloud(12, {0.2, 0.2, 0.2})), make_convex_part(std::move(far), 0.05)};
        scene.add_body(std::move(body));
      }
    }
  }
  return scene;
}

/// Bodies of 1 to 40 convex parts: clouds along a random walk, some of them rounded, some of more than 64 vertices; and
/// boxes in a grid, with many equal distances and gaps. Some share their parts.
inline engine::Scene decomposed_scene(int count, double box, std::uint64_t seed) {
  constexpr int kPieces[] = {1, 2, 8, 27, 3, 1, 17, 40, 5, 12};
  Random random(seed);
  engine::Scene scene, boxes;
  boxes.add_box("one", {0.2, 0.2, 0.2}, {});
  std::vector<ConvexPartPtr> grid;
  for (int i = 0; i < 27; ++i) {
    std::vector<Vec3d> corners = boxes.bodies()[0].parts[0]->vertices;
    for (Vec3d& v : corners) v += Vec3d{0.25 * (i % 3), 0.25 * (i / 3 % 3), 0.25 * (i / 9)};
    grid.push_back(make_convex_part(std::move(corners)));
  }
  for (int i = 0; i < count; ++i) {
    Body body;
    body.name = "body" + std::to_string(i);
    body.pose = random.pose(box);
    body.is_static = i % 7 == 4;
    if (i % 10 == 3) {
      body.parts = grid;
      if (i % 20 == 3)
        body.pose = Pose{{std::round(body.pose->translation.x), std::round(body.pose->translation.y), 0}};
    } else if (i >= 20 && i % 3 == 0) {
      body.parts = scene.bodies()[static_cast<std::size_t>(i % 10)].parts;
    } else {
      Vec3d at{0, 0, 0};
      for (int p = 0; p < kPieces[i % 10]; ++p) {
        std::vector<Vec3d> v =
            random.cloud(p % 6 == 5 ? 90 : 6 + static_cast<int>(random.below(30)), {0.06, 0.06, 0.06});
        for (Vec3d& x : v) x += at;
        at += Vec3d{random.uniform(-0.2, 0.25), random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2)};
        body.parts.push_back(make_convex_part(std::move(v), p % 4 == 2 ? 0.03 : 0.0));
      }
    }
    scene.add_body(std::move(body));
  }
  return scene;
}

}  // namespace clearance::test
