#include "bench/gpu/gpu_workloads.h"

#include <algorithm>

#include "bench/gpu/arm_workload.h"
#include "tests/engine/cuda/arms_scene.h"

namespace clearance::test {

engine::Scene spheres(int count, double box) {
  Random random(7);
  engine::Scene scene, one;
  one.add_uv_sphere("one", 2, 5, {});
  for (int i = 0; i < count; ++i) {
    Body body;
    body.name = "s" + std::to_string(i);
    body.parts = one.bodies()[0].parts;
    body.pose = random.pose(box / 2);
    scene.add_body(std::move(body));
  }
  return scene;
}

namespace {

// 30 hulls of 32 to 256 vertices within reach of each other.
constexpr int kHulls = 30, kHullPairs = 150;
engine::Scene hulls(int fewest, int most) {
  Random random(11);
  engine::Scene scene;
  for (int i = 0; i < kHulls; ++i) {
    const int count = fewest + i * (most - fewest) / (kHulls - 1);
    std::vector<Vec3d> v = random.cloud(count, {1, 1, 1});
    const Vec3d size{random.uniform(0.1, 0.4), random.uniform(0.1, 0.4), random.uniform(0.1, 0.4)};
    for (Vec3d& p : v) {
      p = p * (1 / norm(p));
      p = {p.x * size.x, p.y * size.y, p.z * size.z};
    }
    scene.add_hull("h" + std::to_string(i), v, {.pose = random.pose(1)});
  }
  return scene;
}

// Created once, since their vertices take seconds.
engine::Scene large_spheres() {
  static const engine::Scene scene = [] {
    engine::Scene two;
    for (const double x : {0.0, 4.01}) two.add_uv_sphere(x > 0 ? "b" : "a", 2, 1000, {.pose = Pose{{x, 0, 0}}});
    return two;
  }();
  return scene;
}

engine::Scene hulls() {
  return hulls(32, 256);
}
engine::Scene middle_hulls() {
  return hulls(32, 496);
}
engine::Scene large_hulls() {
  return hulls(600, 4000);
}

constexpr std::uint32_t kBounds = kFieldDistance | kFieldLower | kFieldUpper | kFieldStatus;
constexpr double kFar = std::numeric_limits<double>::infinity();
Workload few(std::size_t pairs) {
  return {"spheres, " + std::to_string(pairs) + (pairs == 1 ? " pair, float32" : " pairs, float32"),
          [] { return spheres(200, 58); },
          0,
          kFloat32,
          Reduce::kNone,
          kFar,
          pairs};
}
// An arm by its joints.
Workload joints(const std::string& what, std::uint32_t configurations, std::uint32_t fields, Reduce reduce,
                double max_distance = kFar, double margin = 0) {
  Workload w{"an arm of 8 hulls, 21 things, " + std::to_string(configurations) + " configurations of joints, " + what,
             arm_scene_of_hulls,
             configurations,
             fields,
             reduce,
             max_distance};
  w.margin = margin;
  return w;
}
// The same arm, or one whose links are meshes, in its surroundings.
struct ArmScene {
  const char* name;
  engine::Scene (*scene)();
};
constexpr ArmScene kInRoom{"an arm of 8 hulls in a cloud of 100,000 points", arm_scene_in_room},
    kInCell{"an arm of 8 hulls in a mesh of 3600 triangles", arm_scene_in_cell},
    kOfMeshes{"an arm of 7 meshes, 21 things", arm_scene_of_meshes},
    kOfMeshesInCell{"an arm of 7 meshes in a mesh of 3600 triangles", arm_scene_of_meshes_in_cell};
Workload of(const ArmScene& arm, const std::string& what, std::uint32_t fields, Reduce reduce,
            double max_distance = kFar, double margin = 0) {
  Workload w = joints(what, 4096, fields, reduce, max_distance, margin);
  w.name = std::string(arm.name) + ", 4096 configurations of joints, " + what;
  w.scene = arm.scene;
  return w;
}
}  // namespace

const std::vector<Workload>& workloads() {
  static const std::vector<Workload> all{
      {"1000 spheres, box 100, float32", [] { return spheres(1000, 100); }, 0, kFloat32},
      {"1000 spheres, box 25, float32", [] { return spheres(1000, 25); }, 0, kFloat32},
      {"1000 spheres, box 100, float32, f32", [] { return spheres(1000, 100); }, 0, kFloat32, Reduce::kNone, kFar, 0,
       Precision::kF32},
      {"1000 spheres, box 25, float32, f32", [] { return spheres(1000, 25); }, 0, kFloat32, Reduce::kNone, kFar, 0,
       Precision::kF32},
      {"1000 spheres, box 100, bounds and status", [] { return spheres(1000, 100); }, 0, kBounds},
      {"5000 spheres, box 171, float32", [] { return spheres(5000, 171); }, 0, kFloat32},
      {"30 hulls, 150 pairs, 4096 configurations, float32", hulls, 4096, kFloat32},
      {"30 hulls, 150 pairs, 4096 configurations, float32 and status", hulls, 4096, kFloat32 | kFieldStatus},
      {"30 hulls, 150 pairs, 4096 configurations, float32, status and flags", hulls, 4096,
       kFloat32 | kFieldStatus | kFieldFlags},
      {"30 hulls, 150 pairs, 4096 configurations, bounds and status", hulls, 4096, kBounds},
      {"30 hulls of 600 to 4000 vertices, 4096 configurations, float32", large_hulls, 4096, kFloat32},
      few(1),
      few(10),
      few(100),
      few(300),
      few(1000),
      few(10000),
      {"2 spheres of 1,998,002 vertices", large_spheres, 0, kFloat32},
      {"1000 spheres, box 100, nearest", [] { return spheres(1000, 100); }, 0, kBounds, Reduce::kNearest},
      {"1000 spheres, box 100, within 2", [] { return spheres(1000, 100); }, 0, kBounds, Reduce::kWithin, 2},
      {"5000 spheres, box 171, nearest", [] { return spheres(5000, 171); }, 0, kBounds, Reduce::kNearest},
      {"5000 spheres, box 171, within 2", [] { return spheres(5000, 171); }, 0, kBounds, Reduce::kWithin, 2},
      {"50000 spheres, box 368, within 2", [] { return spheres(50000, 368); }, 0, kBounds, Reduce::kWithin, 2},
      {"30 hulls, 150 pairs, 4096 configurations, min", hulls, 4096, kBounds, Reduce::kMin},
      {"30 hulls in 27 times the room, 150 pairs, 4096 configurations, min", hulls, 4096, kBounds, Reduce::kMin, kFar,
       0, Precision::kF64, false, 3},
      {"30 hulls of 32 to 496 vertices, 4096 configurations, min", middle_hulls, 4096, kBounds, Reduce::kMin},
      {"2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, float32", arms_scene, 4096, kFloat32},
      {"2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, float32, f32", arms_scene, 4096, kFloat32,
       Reduce::kNone, kFar, 0, Precision::kF32},
      {"2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, near 0.1, float32", arms_scene, 4096, kFloat32,
       Reduce::kNone, 0.1},
      {"2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, min", arms_scene, 4096, kBounds, Reduce::kMin},
      {"2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, depth, float32", arms_scene, 4096, kFloat32,
       Reduce::kNone, kFar, 0, Precision::kF64, true},
      {"30 hulls, 150 pairs, 4096 configurations, depth, float32", hulls, 4096, kFloat32, Reduce::kNone, kFar, 0,
       Precision::kF64, true},
      joints("any", 4096, kFieldStatus | kFieldPair, Reduce::kAny),
      joints("any, margin 0.02", 4096, kFieldStatus | kFieldPair, Reduce::kAny, kFar, 0.02),
      joints("min", 4096, kBounds, Reduce::kMin),
      joints("within 0.02", 4096, kBounds, Reduce::kWithin, 0.02),
      joints("bounds and status", 4096, kBounds, Reduce::kNone),
      joints("any", 65536, kFieldStatus | kFieldPair, Reduce::kAny),
      joints("any", 1048576, kFieldStatus | kFieldPair, Reduce::kAny),
      joints("min", 65536, kBounds, Reduce::kMin),
      of(kInRoom, "any", kFieldStatus | kFieldPair, Reduce::kAny),
      of(kInRoom, "any, margin 0.02", kFieldStatus | kFieldPair, Reduce::kAny, kFar, 0.02),
      of(kInRoom, "min", kBounds, Reduce::kMin),
      of(kInRoom, "nearest", kBounds, Reduce::kNearest),
      of(kInRoom, "within 0.02", kBounds, Reduce::kWithin, 0.02),
      of(kInCell, "any", kFieldStatus | kFieldPair, Reduce::kAny),
      of(kInCell, "any, margin 0.02", kFieldStatus | kFieldPair, Reduce::kAny, kFar, 0.02),
      of(kInCell, "min", kBounds, Reduce::kMin),
      of(kInCell, "nearest", kBounds, Reduce::kNearest),
      of(kInCell, "within 0.02", kBounds, Reduce::kWithin, 0.02),
      of(kOfMeshes, "any", kFieldStatus | kFieldPair, Reduce::kAny),
      of(kOfMeshes, "any, margin 0.02", kFieldStatus | kFieldPair, Reduce::kAny, kFar, 0.02),
      of(kOfMeshes, "min", kBounds, Reduce::kMin),
      of(kOfMeshesInCell, "any", kFieldStatus | kFieldPair, Reduce::kAny),
      of(kOfMeshesInCell, "any, margin 0.02", kFieldStatus | kFieldPair, Reduce::kAny, kFar, 0.02),
      of(kOfMeshesInCell, "min", kBounds, Reduce::kMin),
      of(kOfMeshesInCell, "nearest", kBounds, Reduce::kNearest),
      of(kOfMeshesInCell, "within 0.02", kBounds, Reduce::kWithin, 0.02),
  };
  return all;
}

Requested::Requested(const Workload& w, const engine::Engine& cpu) {
  q.fields = w.fields;
  q.reduce = w.reduce;
  q.max_distance = w.max_distance;
  q.precision = w.precision;
  q.signed_distance = w.depth;
  q.margin = w.margin;
  if (w.scene == arm_scene_of_hulls || w.scene == arm_scene_in_room || w.scene == arm_scene_in_cell ||
      w.scene == arm_scene_of_meshes || w.scene == arm_scene_of_meshes_in_cell) {
    pairs = arm_pairs(cpu.scene());
    for (std::uint32_t j = 0; j < cpu.scene().joints().size(); ++j) joints.push_back(j);
    positions = arm_positions(cpu.scene(), w.configurations, 13);
  } else if (w.scene == arms_scene) {
    for (std::uint32_t b = 0; b < kArms * kLinks; ++b) bodies.push_back(b);
    pairs = arms_pairs();
    poses = arms_poses(w.configurations, 13);
  } else if (w.configurations > 0) {
    for (std::uint32_t b = 0; b < kHulls; ++b) bodies.push_back(b);
    for (std::uint32_t a = 0; a < kHulls && pairs.size() < kHullPairs; ++a)
      for (std::uint32_t b = a + 1; b < kHulls && pairs.size() < kHullPairs; b += 2) pairs.push_back({a, b});
    Random random(13);
    for (std::size_t i = 0; i < std::size_t{w.configurations} * kHulls; ++i) poses.push_back(random.pose(w.room));
  }
  if (w.configurations > 0) {
    q.all_pairs = false;
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
    q.joints = joints;
    q.positions = positions;
    q.configuration_count = w.configurations;
  }
  if (w.first_pairs > 0) {
    pairs = cpu.pairs(q);
    pairs.resize(std::min(pairs.size(), w.first_pairs));
    q.all_pairs = false;
    q.pairs = pairs;
  }
}

}  // namespace clearance::test
