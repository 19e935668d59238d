// Two arms among obstacles, all decomposed into convex parts: typical queries of planners.
#pragma once

#include <cmath>

#include "tests/engine/engine_test_util.h"

namespace clearance::test {

inline constexpr std::uint32_t kLinks = 7, kArms = 2, kObstacles = 10;

/// A body whose convex parts are hulls of points on ellipsoids.
/// \param middles of each
/// \param sizes of each
inline void add_ellipsoids(engine::Scene& scene, const std::string& name, const std::vector<Vec3d>& middles,
                           const std::vector<Vec3d>& sizes, std::optional<Pose> pose, bool is_static, Random& random) {
  Body body;
  body.name = name;
  body.pose = pose;
  body.is_static = is_static;
  for (std::size_t p = 0; p < middles.size(); ++p) {
    std::vector<Vec3d> v = random.cloud(16 + static_cast<int>(random.below(33)), {1, 1, 1});
    for (Vec3d& x : v) {
      x = x * (1 / norm(x));
      x = Vec3d{x.x * sizes[p].x, x.y * sizes[p].y, x.z * sizes[p].z} + middles[p];
    }
    body.parts.push_back(make_convex_part(std::move(v)));
  }
  scene.add_body(std::move(body));
}

inline void add_boxes(engine::Scene& scene, const std::string& name, const std::vector<Vec3d>& middles,
                      const std::vector<Vec3d>& sizes, const Pose& pose) {
  Body body;
  body.name = name;
  body.pose = pose;
  body.is_static = true;
  for (std::size_t p = 0; p < middles.size(); ++p) {
    std::vector<Vec3d> v;
    for (int corner = 0; corner < 8; ++corner)
      v.push_back(Vec3d{corner & 1 ? 0.5 * sizes[p].x : -0.5 * sizes[p].x,
                        corner & 2 ? 0.5 * sizes[p].y : -0.5 * sizes[p].y,
                        corner & 4 ? 0.5 * sizes[p].z : -0.5 * sizes[p].z} +
                  middles[p]);
    body.parts.push_back(make_convex_part(std::move(v)));
  }
  scene.add_body(std::move(body));
}

/// Links of five convex parts with 16 to 48 vertices; a table of five boxes, three shelves of six, six objects of eight
/// hulls.
inline engine::Scene arms_scene() {
  Random random(23);
  engine::Scene scene;
  for (std::uint32_t arm = 0; arm < kArms; ++arm)
    for (std::uint32_t link = 0; link < kLinks; ++link) {
      std::vector<Vec3d> middles, sizes;
      const double width = 0.07 - 0.005 * link;
      for (int p = 0; p < 5; ++p) {
        middles.push_back({random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01), 0.025 + 0.05 * p});
        sizes.push_back({width * random.uniform(0.7, 1), width * random.uniform(0.7, 1), 0.045});
      }
      add_ellipsoids(scene, "arm" + std::to_string(arm) + "_" + std::to_string(link), middles, sizes, std::nullopt,
                     false, random);
    }
  const double w = 1.6, d = 1.0, h = 0.7;
  add_boxes(scene, "table",
            {{0, 0, 0}, {-0.75, -0.45, -0.35}, {0.75, -0.45, -0.35}, {-0.75, 0.45, -0.35}, {0.75, 0.45, -0.35}},
            {{w, d, 0.04}, {0.06, 0.06, h}, {0.06, 0.06, h}, {0.06, 0.06, h}, {0.06, 0.06, h}}, Pose{{0, 0, -0.1}});
  for (int s = 0; s < 3; ++s)
    add_boxes(scene, "shelf" + std::to_string(s),
              {{-0.4, 0, 0}, {0.4, 0, 0}, {0, 0, -0.45}, {0, 0, 0}, {0, 0, 0.45}, {0, 0.14, 0}},
              {{0.03, 0.3, 1}, {0.03, 0.3, 1}, {0.8, 0.3, 0.03}, {0.8, 0.3, 0.03}, {0.8, 0.3, 0.03}, {0.8, 0.02, 1}},
              Pose{{-0.9 + 0.9 * s, 0.6, 0.5}});
  for (std::uint32_t o = 4; o < kObstacles; ++o) {
    std::vector<Vec3d> middles, sizes;
    for (int p = 0; p < 8; ++p) {
      middles.push_back({random.uniform(-0.08, 0.08), random.uniform(-0.08, 0.08), 0.03 * p});
      sizes.push_back({random.uniform(0.02, 0.06), random.uniform(0.02, 0.06), random.uniform(0.02, 0.04)});
    }
    add_ellipsoids(scene, "thing" + std::to_string(o), middles, sizes,
                   Pose{{-0.75 + 0.3 * (o - 4), random.uniform(0.1, 0.3), 0}}, true, random);
  }
  return scene;
}

/// Every link with every obstacle, and the links of one arm with those of the other.
inline std::vector<BodyPair> arms_pairs() {
  std::vector<BodyPair> pairs;
  for (std::uint32_t a = 0; a < kArms * kLinks; ++a)
    for (std::uint32_t b = a < kLinks ? kLinks : kArms * kLinks; b < kArms * kLinks + kObstacles; ++b)
      pairs.push_back({a, b});
  return pairs;
}

/// Link poses for random joint positions: (configurations, arms, links).
inline std::vector<Pose> arms_poses(std::uint32_t configurations, std::uint64_t seed) {
  Random random(seed);
  std::vector<Pose> poses;
  for (std::uint32_t k = 0; k < configurations; ++k)
    for (std::uint32_t arm = 0; arm < kArms; ++arm) {
      Pose at{{arm == 0 ? -0.45 : 0.45, -0.2, 0}};
      for (std::uint32_t link = 0; link < kLinks; ++link) {
        const double half = 0.5 * (link % 2 == 0 ? random.uniform(-2.9, 2.9) : random.uniform(-1.4, 1.4));
        const Pose turn{
            {0, 0, 0}, std::cos(half), 0, link % 2 == 0 ? 0 : std::sin(half), link % 2 == 0 ? std::sin(half) : 0};
        at = compose(at, turn);
        poses.push_back(at);
        at = compose(at, Pose{{0, 0, 0.25}});
      }
    }
  return poses;
}

}  // namespace clearance::test
