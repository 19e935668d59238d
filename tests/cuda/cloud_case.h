// Convex bodies that move before a cloud that stays.
#pragma once

#include <cmath>
#include <vector>

#include "engine/engine.h"
#include "same_answer.h"

namespace clearance::test {

enum class CloudKind { kPoints, kGrown, kVoxels };

/// Some convex bodies that move, one of them of two pieces, before a cloud that stays and a box.
/// \param room they are up to so far from the origin along each axis \param edge of voxels
struct CloudCase {
  CloudCase(CloudKind kind, std::size_t points, double room, std::uint32_t configurations, std::uint64_t seed,
            bool cloud_first, double edge = 0.05) {
    Random random(seed);
    std::vector<CloudPoint> cloud;
    for (std::size_t i = 0; i < points; ++i) {  // a sheet with waves, a heap, and some far away
      const double u = random.uniform(-1, 1), v = random.uniform(-1, 1);
      const Vec3d p = i % 10 == 9  ? Vec3d{random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3)}
                      : i % 3 == 0 ? Vec3d{0.3 * u, 0.3 * v, 0.4 + 0.2 * random.uniform(-1, 1)}
                                   : Vec3d{u, v, 0.2 * std::sin(4 * u) * std::cos(3 * v)};
      const auto at = [&](double x) {
        return static_cast<float>(kind == CloudKind::kVoxels ? edge * std::round(x / edge) : x);
      };
      cloud.push_back({at(p.x), at(p.y), at(p.z)});
    }
    const auto add_cloud = [&] {
      Scene::BodyOptions options{.is_static = true, .pose = random.pose(0.2)};
      if (kind == CloudKind::kGrown) options.radius = 0.03;
      scene.add_points("cloud", cloud, kind == CloudKind::kVoxels ? edge : 0, options);
    };
    if (cloud_first) add_cloud();
    scene.add_hull("hull", cloud_on_sphere(60, 0.3, 4), {});
    scene.add_box("box", {0.3, 0.5, 0.1}, {});
    scene.add_capsule("capsule", 0.1, 0.4, {});
    Body two;
    two.name = "two";
    two.pieces = {make_piece({{0, 0, 0}, {0.2, 0, 0}, {0, 0.2, 0}, {0, 0, 0.2}}),
                  make_piece({{0.3, 0, 0}, {0.5, 0, 0}, {0.4, 0.2, 0}, {0.4, 0, 0.3}, {0.45, 0.3, 0.3}}, 0.02)};
    scene.add_body(std::move(two));
    if (!cloud_first) add_cloud();
    scene.add_box("wall", {0.1, 2, 2}, {.is_static = true, .pose = Pose{{1.5, 0, 0}}});
    const std::uint32_t first = cloud_first ? 1 : 0, cloud_at = cloud_first ? 0 : 4;
    for (std::uint32_t b = first; b < first + 4; ++b) {
      bodies.push_back(b);
      pairs.push_back(b % 2 ? BodyPair{cloud_at, b} : BodyPair{b, cloud_at});
      pairs.push_back({b, 5});
    }
    for (std::size_t i = 0; i < configurations * bodies.size(); ++i) poses.push_back(random.pose(room));
    q.all_pairs = false;
    q.fields = kAllFields;
    q.configuration_count = configurations;
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
  }

  Scene scene;
  std::vector<std::uint32_t> bodies;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;
};

}  // namespace clearance::test
