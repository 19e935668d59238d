// Moving convex bodies and a fixed cloud or mesh.
#pragma once

#include <cmath>
#include <vector>

#include "engine/engine.h"
#include "tests/engine/cuda/box_mesh.h"
#include "tests/engine/cuda/same_answer.h"

namespace clearance::test {

enum class ElementKind { kPoints, kGrown, kVoxels, kSurface, kSolid, kGrownSolid };

inline bool is_mesh(ElementKind kind) {
  return kind >= ElementKind::kSurface;
}

/// Points of a wavy sheet, of a heap, and some far away.
/// \param edge of voxels; 0 for points
inline std::vector<CloudPoint> points_of_case(Random& random, std::size_t count, double edge) {
  std::vector<CloudPoint> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double u = random.uniform(-1, 1), v = random.uniform(-1, 1);
    const Vec3d p = i % 10 == 9  ? Vec3d{random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3)}
                    : i % 3 == 0 ? Vec3d{0.3 * u, 0.3 * v, 0.4 + 0.2 * random.uniform(-1, 1)}
                                 : Vec3d{u, v, 0.2 * std::sin(4 * u) * std::cos(3 * v)};
    const auto at = [&](double x) { return static_cast<float>(edge > 0 ? edge * std::round(x / edge) : x); };
    points.push_back({at(p.x), at(p.y), at(p.z)});
  }
  return points;
}

/// A shelf of overlapping boards, a block whose triangles face inward, and a box with a cavity.
struct MeshOfCase : BoxMesh {
  static constexpr Vec3d kInBlock{0, 1.2, 0}, kInCavity{0, -1.3, 0};
  /// In the block, in the cavity, in the shelf, and outside of all.
  static constexpr Vec3d kPlaces[] = {kInBlock, kInCavity, {0, -0.1, 0.5}, {0, 0, 2}};
  /// \param cells along each edge of a box
  explicit MeshOfCase(std::uint32_t cells) {
    for (const double z : {-1.0, 0.0, 1.0}) add_box({0, 0, z}, {1, 0.5, 0.025}, cells, false);
    for (const double x : {-1.0, 1.0}) add_box({x, 0, 0}, {0.025, 0.5, 1}, cells, false);
    add_box({0, 0.475, 0}, {1, 0.025, 1}, cells, false);
    add_box(kInBlock, {0.6, 0.45, 0.6}, cells, true);
    add_box(kInCavity, {0.7, 0.6, 0.7}, cells, false);
    add_box(kInCavity, {0.5, 0.42, 0.5}, cells, true);
  }
};

/// Some moving convex bodies, one of two convex parts, with a body of elements and a fixed box.
struct ElementCase {
  /// The bodies are at most `room` from the origin along each axis.
  /// \param size number of points, or cells along each edge of a mesh's boxes
  /// \param edge of voxels
  /// \param elements_move whether the elements move too
  ElementCase(ElementKind kind, std::size_t size, double room, std::uint32_t configurations, std::uint64_t seed,
              bool elements_first, double edge = 0.05, bool elements_move = false) {
    Random random(seed);
    const double voxel = kind == ElementKind::kVoxels ? edge : 0;
    const auto points = is_mesh(kind) ? std::vector<CloudPoint>() : points_of_case(random, size, voxel);
    const auto add_elements = [&] {
      engine::Scene::BodyOptions options{.is_static = !elements_move, .pose = random.pose(0.2)};
      if (kind == ElementKind::kGrown || kind == ElementKind::kGrownSolid) options.radius = 0.03;
      if (!is_mesh(kind)) {
        scene.add_points("elements", points, voxel, options);
        return;
      }
      const MeshOfCase mesh(static_cast<std::uint32_t>(size));
      scene.add_mesh("elements", mesh.vertices, mesh.triangles,
                     kind == ElementKind::kSurface ? MeshAs::kSurface : MeshAs::kSolid, options);
    };
    if (elements_first) add_elements();
    scene.add_hull("hull", cloud_on_sphere(60, 0.3, 4), {});
    scene.add_box("box", {0.3, 0.5, 0.1}, {});
    scene.add_capsule("capsule", 0.1, 0.4, {});
    Body two;
    two.name = "two";
    two.parts = {make_convex_part({{0, 0, 0}, {0.2, 0, 0}, {0, 0.2, 0}, {0, 0, 0.2}}),
                 make_convex_part({{0.3, 0, 0}, {0.5, 0, 0}, {0.4, 0.2, 0}, {0.4, 0, 0.3}, {0.45, 0.3, 0.3}}, 0.02)};
    scene.add_body(std::move(two));
    if (!elements_first) add_elements();
    scene.add_box("wall", {0.1, 2, 2}, {.is_static = true, .pose = Pose{{1.5, 0, 0}}});
    const std::uint32_t first = elements_first ? 1 : 0, elements_at = elements_first ? 0 : 4;
    for (std::uint32_t b = first; b < first + 4; ++b) {
      bodies.push_back(b);
      pairs.push_back(b % 2 ? BodyPair{elements_at, b} : BodyPair{b, elements_at});
      pairs.push_back({b, 5});
    }
    if (elements_move) bodies.push_back(elements_at);
    for (std::size_t i = 0; i < configurations * bodies.size(); ++i) poses.push_back(random.pose(room));
    elements_pose_ = *scene.bodies()[elements_at].pose;
    q.all_pairs = false;
    q.fields = kAllFields;
    q.configuration_count = configurations;
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
  }

  /// Moves the convex bodies of a configuration to a place in the elements' frame.
  void put(std::uint32_t k, const Vec3d& place, Random& random) {
    Pose* const at = poses.data() + k * bodies.size();
    for (std::size_t i = 0; i < 4; ++i) {
      Pose local = random.pose(0.02);
      local.translation = local.translation + place;
      at[i] = compose(bodies.size() > 4 ? at[4] : elements_pose_, local);
    }
  }

  engine::Scene scene;
  std::vector<std::uint32_t> bodies;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;

 private:
  Pose elements_pose_;
};

}  // namespace clearance::test
