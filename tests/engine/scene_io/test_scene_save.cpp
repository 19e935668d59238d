// A saved scene is the same scene again: ids, pairs, convex parts, and answers to the last bit.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "engine/bvh/surface.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/same_rows.h"
#include "tests/error_text.h"
#include "tests/source_file.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using test::Answer;
using test::evaluate;
using test::expect_same_rows;

/// Saves a scene in a new folder and loads it again.
engine::Scene again(const engine::Scene& scene, const TemporaryFolder& folder) {
  const std::string to = folder / "saved";
  std::filesystem::remove_all(to);
  scene.save(to);
  return engine::Scene::load(to + "/scene.yaml");
}

void expect_same_parts(const engine::Scene& one, const engine::Scene& other) {
  ASSERT_EQ(one.bodies().size(), other.bodies().size());
  for (std::uint32_t i = 0; i < one.bodies().size(); ++i) {
    const Body &a = one.bodies()[i], &b = other.bodies()[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.source, b.source) << a.name;
    EXPECT_EQ(a.reach, b.reach) << a.name;
    EXPECT_EQ(a.model_inner, b.model_inner) << a.name;
    EXPECT_EQ(a.hull_excess, b.hull_excess) << a.name;
    EXPECT_EQ(a.display != nullptr, b.display != nullptr) << a.name;
    ASSERT_EQ(a.parts.size(), b.parts.size()) << a.name;
    for (std::size_t p = 0; p < a.parts.size(); ++p) {
      EXPECT_EQ(a.parts[p]->radius, b.parts[p]->radius) << a.name;
      ASSERT_EQ(a.parts[p]->surface != nullptr, b.parts[p]->surface != nullptr) << a.name;
      if (a.parts[p]->surface) {
        EXPECT_EQ(a.parts[p]->surface->digest(), b.parts[p]->surface->digest()) << a.name;
      }
      ASSERT_EQ(a.parts[p]->vertices.size(), b.parts[p]->vertices.size()) << a.name;
      EXPECT_EQ(std::memcmp(a.parts[p]->vertices.data(), b.parts[p]->vertices.data(),
                            a.parts[p]->vertices.size() * sizeof(Vec3d)),
                0)
          << a.name;
    }
  }
}

/// Also compares answers for all pairs at the initial poses and positions, or for many pairs only the nearest of each
/// body.
void expect_same(const engine::Scene& one, const engine::Scene& other) {
  expect_same_parts(one, other);
  EXPECT_EQ(one.revision(), other.revision());
  ASSERT_EQ(one.groups().size(), other.groups().size());
  const engine::Engine a(one, {.threads = 1}), b(other, {.threads = 1});
  QueryView query;
  const bool many = a.size(query).pairs > 100'000;
  if (many) query.reduce = Reduce::kNearest;
  if (!many) {
    EXPECT_EQ(a.pairs({}), b.pairs({}));
  }
  query.fields = many ? kDefaultFields | kFieldPair : test::kAllFields & ~(kFieldPair | kFieldConfiguration);
  const Answer expected = evaluate(a, query), got = evaluate(b, query);
  ASSERT_EQ(expected.size.rows, got.size.rows);
  expect_same_rows(expected, 0, got, expected.size.rows);
}

TEST(SavedScene, EveryOneOfTheFolderComesBack) {
  const TemporaryFolder folder;
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(source_file("scenes"))) {
    const std::string name = entry.path().filename().string();
    if (name == "two_spheres" || name == "random_5000") continue;  // large
    if (!std::filesystem::exists(entry.path() / "scene.yaml")) continue;
    SCOPED_TRACE(name);
    const engine::Scene scene = engine::Scene::load((entry.path() / "scene.yaml").string());
    expect_same(scene, again(scene, folder));
    ++count;
  }
  EXPECT_GE(count, 8);
}

/// Two robots, bodies before, between and after them, and every property that a body in a scene can have.
engine::Scene everything(const TemporaryFolder& folder) {
  folder.write("own/tip.obj", "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const std::string urdf = folder.write("hand.urdf", R"(<robot name="hand"><link name="wrist"><collision><geometry>
      <box size="0.1 0.2 0.3"/></geometry></collision><collision><origin xyz="0.3 0 0" rpy="0.1 0.2 0.3"/><geometry>
      <cylinder radius="0.1" length="0.2"/></geometry></collision></link>
      <link name="tip"><collision><origin xyz="0 0.1 0" rpy="0.3 0 0"/><geometry>
      <mesh filename="package://own/tip.obj" scale="1 1.5 2"/></geometry></collision></link>
      <link name="loose"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
      <joint name="turn" type="revolute"><parent link="wrist"/><child link="tip"/><origin xyz="0 0 0.4"/>
      <limit lower="-2" upper="2"/></joint>
      <joint name="float" type="floating"><parent link="wrist"/><child link="loose"/></joint></robot>)");
  const std::string srdf =
      folder.write("hand.srdf", R"(<robot name="hand"><group name="all"><joint name="turn"/></group>
      <group_state name="open" group="all"><joint name="turn" value="0.1"/></group_state>
      <disable_collisions link1="wrist" link2="loose" reason="Never"/></robot>)");
  engine::Scene scene;
  scene.add_box("table \"A\" \\ é", {1, 1, 0.1}, {.is_static = true, .pose = Pose{{0.5, 0, -0.1}}});
  scene.add_robot("arm", {.urdf = test::kArm,
                          .parent = "table \"A\" \\ é",
                          .base = {{0, 0, 0.1}},
                          .is_static = true,
                          .home = {{{"joint4", -1.5}}},
                          .padding = 0.01,
                          .link_uncertainty = {{"fore", {0.01, 0.002}}, {"shoulder", {0.1, 0}}}});
  scene.add_sphere("held", 0.04, {.parent = "arm/palm", .pose = Pose{{0, 0, 0.1}}});
  scene.add_robot("hand", {.urdf = urdf,
                           .srdf = srdf,
                           .packages = {{"own", folder / "own"}},
                           .base = {{1, 0.2, 0.3}, 2, 0, 0.1, 0},
                           .mesh_as = MeshAs::kSolid,
                           .home_state = "open"});
  scene.add_capsule("vague", 0.1, 0.3, {.pose = Pose{{0.1, 0.7, 0.3}}, .uncertainty = {0.1, 0.02}, .padding = 0.3});
  scene.add_cylinder("round", 0.1, 0.3,
                     {.radius = 0, .pose = Pose{{-0.7, 0.1 / 3, 1e-9}, 0.3, 0.1, -0.0, 7}, .requires_pose = true});
  const std::vector<Vec3d> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.1, 0.1, 0.1}};
  const std::vector<Triangle> skin{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}};
  scene.add_mesh("open", corners, skin, MeshAs::kSurface, {.radius = 0.01, .pose = Pose{{2, 2, 2}}, .padding = 0.1});
  scene.add_half_space("floor", {.pose = Pose{{0, 0, -3}, 1, 0.1, 0, 0}, .uncertainty = {0.01, 0}, .padding = 0.02});
  scene.add_cone("cone", 0.1, 0.4, {.pose = Pose{{-1.5, 0, 0.2}}, .padding = 0.01});
  scene.add_ellipsoid("egg", {0.1, 0.2, 0.3}, {.radius = 0.03, .pose = Pose{{-1.5, 1, 0.2}, 1, 2, 3, 4}});
  scene.add_box("nowhere", {1, 2, 3}, {.max_speed = 0.5});  // without a pose, whose age would be in answers
  const std::vector<std::string> members{"round", "arm/palm"};
  scene.add_group("some", members);
  scene.ignore("hand", "some");
  scene.set_parent("hand", "vague");  // which came later
  return scene;
}

TEST(SavedScene, RobotsAndAllThatIsDeclaredOfBodiesComeBack) {
  const TemporaryFolder folder;
  const engine::Scene scene = everything(folder);
  const engine::Scene saved = again(scene, folder);
  expect_same(scene, saved);
  ASSERT_EQ(saved.robots().size(), 2u);
  for (const char* name : {"hand/tip", "open"})
    EXPECT_TRUE(surface_of(saved.bodies()[saved.find_body(name)])) << name << ": its triangles come back, too";
  EXPECT_EQ(saved.joints().size(), scene.joints().size());
  EXPECT_EQ(*saved.joints()[saved.find_joint("hand/turn")].home, 0.1);
  EXPECT_EQ(saved.joint_groups().size(), scene.joint_groups().size());
  // The original files are not needed.
  const engine::Scene by_itself = [&] {
    for (const char* gone : {"hand.urdf", "hand.srdf", "own"}) std::filesystem::remove_all(folder / gone);
    return engine::Scene::load(folder / "saved/scene.yaml");
  }();
  expect_same(scene, by_itself);
  const TemporaryFolder elsewhere;
  expect_same(scene, again(saved, elsewhere));

  // Joints move the same bodies as before.
  const engine::Engine a(scene, {.threads = 1}), b(saved, {.threads = 1});
  const std::uint32_t joints[] = {scene.find_joint("arm/joint2"), scene.find_joint("hand/turn")};
  const double rows[] = {0.1, 0.2, -0.5, 1.9, 0.3, 2.5};
  QueryView query;
  query.joints = joints;
  query.positions = rows;
  query.configuration_count = 3;
  query.fields = test::kAllFields & ~(kFieldPair | kFieldConfiguration);
  const Answer expected = evaluate(a, query), got = evaluate(b, query);
  ASSERT_GT(expected.size.rows, 50u);
  const auto seen = expect_same_rows(expected, 0, got, expected.size.rows);
  EXPECT_GT(seen[static_cast<int>(Status::kOk)], 20u);
}

TEST(SavedScene, IgnoringEverythingSaysNothingOfFrames) {
  const TemporaryFolder folder;
  engine::Scene scene = test::arm_scene(test::at_home());
  scene.ignore("ball", "*");  // includes the frame "arm", whose name is that of a group, too
  scene.add_sphere("other", 0.1, {.pose = Pose{{0.4, 0.3, 0.9}}});
  const engine::Scene saved = again(scene, folder);
  expect_same_parts(scene, saved);
  EXPECT_EQ(engine::Engine(scene).pairs({}), engine::Engine(saved).pairs({}));
}

TEST(SavedScene, WhatCannotBeSavedIsReported) {
  const TemporaryFolder folder;
  const auto error = [&](const engine::Scene& scene, const std::string& to) {
    return error_text<engine::SceneError>([&] { scene.save(to); });
  };
  engine::Scene scene;
  EXPECT_EQ(error(scene, folder / "a"), "save: " + (folder / "a") + ": there are no bodies to be saved");
  scene.add_box("box", {1, 1, 1}, {});
  folder.write("full/note", "here before");
  EXPECT_EQ(error(scene, folder / "full"),
            "save: " + (folder / "full") + ": expected a folder that is empty or not there yet");
  EXPECT_EQ(error(scene, folder / "full/note"),
            "save: " + (folder / "full/note") + ": expected a folder that is empty or not there yet");
  EXPECT_NE(error(scene, folder / "full/note/under").find("Not a directory"), std::string::npos);
  engine::Scene loose = everything(folder);
  loose.set_parent("hand/loose", "vague");
  EXPECT_EQ(error(loose, folder / "b"),
            "save: " + (folder / "b") +
                ": the link \"hand/loose\" has a parent or requires a pose, which a scene file "
                "cannot express for a link");
}

TEST(SavedScene, WhatIsWrongWithItsFilesIsReportedWithItsPlace) {
  const TemporaryFolder folder;
  engine::Scene scene;
  scene.add_box("box", {1, 1, 1}, {});
  scene.add_robot("arm", {.urdf = test::kArm});
  scene.save(folder / "s");
  std::string file;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "s/geometry")) file = entry.path().filename();
  std::ifstream written((folder / "s/geometry/") + file, std::ios::binary);
  const std::string good{std::istreambuf_iterator<char>(written), {}};
  const auto load = [&](const std::string& yaml) {
    folder.write("s/other.yaml", yaml);
    return error_text<engine::SceneError>([&] { engine::Scene::load(folder / "s/other.yaml"); });
  };
  const std::string body = "bodies:\n  - {name: b, geometry: geometry/" + file + "}\n";
  const auto damaged = [&](const std::string& bytes) {
    folder.write("s/geometry/" + file, bytes);
    const std::string text = load(body), place = (folder / "s/other.yaml") + ":2: bodies[0].geometry: ";
    EXPECT_EQ(text.substr(0, place.size()), place);
    return text;
  };
  const auto has = [](const std::string& text, const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  EXPECT_EQ(load(body), "");
  for (const std::size_t at : {std::size_t{30}, good.size() / 2, good.size() - 1}) {
    std::string bytes = good;
    bytes[at] ^= 1;
    has(damaged(bytes), "damaged: its content is not that of its digest");
  }
  has(damaged(good.substr(0, 40)), "it ends early");
  has(damaged(good.substr(0, good.size() - 8)), "damaged");
  has(damaged(""), "no geometry as Scene::save() writes it");
  has(damaged("solid x\n"), "no geometry as Scene::save() writes it");
  std::filesystem::remove((folder / "s/geometry/") + file);
  has(load(body), "No such file or directory");
  folder.write("s/geometry/" + file, good);

  has(load("bodies:\n  - {name: b, geometry: ../" + file + "}\n"), "leaves the scene's folder");
  has(load("bodies:\n  - {name: b, geometry: geometry/" + file + ", radius: 0.1}\n"),
      "bodies[0].radius: a geometry's pieces have their radius already");
  has(load("bodies:\n  - {name: b, geometry: geometry/" + file + ", box: 1}\n"), "a body has one geometry");
  const std::string robot = "robots:\n  - {name: arm, urdf: robots/0.urdf, geometry: {";
  EXPECT_EQ(load("bodies:\n  - {robot: arm}\n" + robot + "base: geometry/" + file + "}}\n"), "");
  has(load("bodies:\n  - {robot: leg}\n" + robot + "}}\n"),
      ":2: bodies[0].robot: there is no robot \"leg\" under \"robots\"");
  has(load("bodies:\n  - {robot: arm}\n  - {robot: arm}\n" + robot + "}}\n"), "the robot \"arm\" is listed already");
  has(load("bodies:\n  - {robot: arm, pose: [0, 0, 0, 1, 0, 0, 0]}\n" + robot + "}}\n"), "unknown key \"pose\"");
  has(load(robot + "bass: geometry/" + file + "}}\n"), "robot \"arm\": geometry: there is no link \"bass\"");
  has(load(robot + "base: robots/0.urdf}}\n"), "robots/0.urdf: no geometry as Scene::save() writes it");
}

}  // namespace
}  // namespace clearance
