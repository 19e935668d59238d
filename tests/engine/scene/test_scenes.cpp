// The scenes of the repository load, with their documented contents.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>

#include "engine/scene/scene.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

engine::Scene load(const std::string& name) {
  return engine::Scene::load(source_file("scenes/" + name + "/scene.yaml"));
}

const Body& body(const engine::Scene& scene, const std::string& name) {
  const std::uint32_t id = scene.find_body(name);
  EXPECT_NE(id, kNone) << name;
  return scene.bodies().at(id);
}

TEST(Scenes, RandomOnesHaveAsManySpheresAsTheirNameSays) {
  for (const std::size_t count : {10u, 100u, 200u, 1000u, 5000u}) {
    const engine::Scene scene = load("random_" + std::to_string(count));
    ASSERT_EQ(scene.bodies().size(), count);
    for (const Body& b : scene.bodies()) {
      ASSERT_EQ(b.parts.at(0), scene.bodies()[0].parts.at(0));
      ASSERT_TRUE(b.pose && !b.is_static);
    }
    EXPECT_EQ(scene.bodies()[0].parts[0]->vertices.size(), 42u);
    EXPECT_NEAR(scene.bodies()[0].parts[0]->rho, 2, 1e-12);
  }
}

TEST(Scenes, TwoSpheresShareTheirTwoMillionVertices) {
  const engine::Scene scene = load("two_spheres");
  ASSERT_EQ(scene.bodies().size(), 2u);
  EXPECT_EQ(scene.bodies()[0].parts[0], scene.bodies()[1].parts[0]);
  EXPECT_EQ(scene.bodies()[0].parts[0]->vertices.size(), 1998002u);
  EXPECT_TRUE(scene.bodies()[0].parts[0]->table);
}

TEST(Scenes, BenchmarkLiteHas2400TrianglesABody) {
  const engine::Scene scene = load("benchmark_lite");
  ASSERT_EQ(scene.bodies().size(), 2u);
  for (const Body& b : scene.bodies()) EXPECT_EQ(b.display->triangles.size(), 2400u);
}

TEST(Scenes, NineteenHasEveryFormatAndEveryPrimitive) {
  const engine::Scene scene = load("nineteen");
  EXPECT_EQ(scene.bodies().size(), 19u);
  std::set<std::string> sources;
  for (const Body& b : scene.bodies()) {
    const std::size_t dot = b.source.rfind('.');
    sources.insert(dot == std::string::npos ? b.source : b.source.substr(dot, b.source.find(' ', dot) - dot));
    EXPECT_TRUE(b.pose && b.display) << b.name;
  }
  for (const char* wanted : {".obj", ".stl", ".ply", ".off", ".dae", ".gltf", ".glb", "box", "sphere", "capsule",
                             "cylinder", "points", "uv_sphere"})
    EXPECT_EQ(sources.count(wanted), 1u) << wanted;
  EXPECT_EQ(body(scene, "mug").parts.size(), 18u);
  EXPECT_EQ(body(scene, "chair").parts.size(), 6u);
}

TEST(Scenes, PrimitivesHasEveryClosedForm) {
  const engine::Scene scene = load("primitives");
  std::set<std::string> sources;
  for (const Body& b : scene.bodies()) sources.insert(b.source);
  for (const char* wanted : {"half_space", "cone", "ellipsoid", "cylinder", "box", "sphere"})
    EXPECT_EQ(sources.count(wanted), 1u) << wanted;
  EXPECT_TRUE(body(scene, "floor").is_static);
}

TEST(Scenes, CellHasAnArmThatHoldsACup) {
  const engine::Scene scene = load("cell");
  EXPECT_EQ(body(scene, "cup").parent, scene.find_body("gripper"));
  EXPECT_EQ(body(scene, "gripper").parent, scene.find_body("flange"));
  ASSERT_NE(scene.find_group("arm"), kNone);
  EXPECT_EQ(scene.groups()[scene.find_group("arm")].bodies.size(), 9u);
  EXPECT_NE(scene.find_group("clutter"), kNone);
  const std::pair adjacent{scene.find_body("upper_arm"), scene.find_body("forearm")};  // in the file's order
  EXPECT_TRUE(std::binary_search(scene.ignored().begin(), scene.ignored().end(), adjacent));
  EXPECT_GE(body(scene, "gripper").parts.size(), 6u);
  EXPECT_TRUE(body(scene, "table").is_static);
}

TEST(Scenes, ExtremesKeepTheirExtremes) {
  const engine::Scene scene = load("extremes");
  EXPECT_LT(body(scene, "tiny").parts[0]->rho, 1.1e-9);
  EXPECT_GT(body(scene, "huge").parts[0]->rho, 8e8);
  EXPECT_EQ(body(scene, "flat").parts[0]->half.z, 0);
  EXPECT_EQ(body(scene, "point").parts[0]->vertices.size(), 1u);
  EXPECT_EQ(body(scene, "straight").parts[0]->vertices.size(), 5u);
  EXPECT_EQ(body(scene, "repeated").parts[0]->vertices.size(), 4u);
  const ConvexPart& far = *body(scene, "far_from_its_frame").parts[0];
  EXPECT_GT(far.rho, 4600);
  EXPECT_NEAR(far.spread, 1, 0.01);
}

// Every scene of the folder is in one of the tests above, or here.
TEST(Scenes, EveryOneLoads) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(source_file("scenes"))) {
    if (!std::filesystem::exists(entry.path() / "scene.yaml")) continue;
    ++count;
    const std::string name = entry.path().filename().string();
    if (name == "two_spheres") continue;  // large, and loaded above
    const engine::Scene scene = load(name);
    EXPECT_EQ(scene.revision(), load(name).revision()) << name;
    for (const Body& b : scene.bodies()) EXPECT_TRUE(b.pose) << name << " " << b.name;
  }
  EXPECT_GE(count, 11);
}

}  // namespace
}  // namespace clearance
