// The scene file: the meaning of each key.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "engine/bvh/surface.h"
#include "engine/hull/primitive.h"
#include "engine/scene/scene.h"
#include "tests/engine/scene_io/scene_text.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using test::kTetrahedron;
using test::load_text;

constexpr const char* kTwoObjects =
    "o first\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    "o second\nv 5 0 0\nv 6 0 0\nv 5 1 0\nv 5 0 1\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n";

TEST(SceneFile, EveryKeyOfABody) {
  const TemporaryFolder folder;
  folder.write("meshes/t.obj", kTetrahedron);
  folder.write("meshes/two.obj", kTwoObjects);
  const engine::Scene scene = load_text(folder, R"(
bodies:
  - {name: cup, box: [0.1, 0.2, 0.3], parent: gripper, pose: [0, 0, 0.5, 1, 0, 0, 0]}   # the parent comes later
  - {name: base, mesh: meshes/t.obj, scale: 2, static: true, pose: [1, 2, 3, 0.5, 0.5, 0.5, 0.5]}
  - name: gripper
    mesh: meshes/two.obj
    scale: [1, -1, 0.5]
    mesh_as: parts
    radius: 0.25
  - {name: ball, sphere: 0.5}
  - {name: pill, capsule: [0.5, 2]}
  - {name: can, cylinder: [0.5, 2]}
  - {name: dots, points: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-3], [+.5, 0, 0]]}
  - {name: globe, uv_sphere: {radius: 2, resolution: 5}}
  - {name: cube, box: 2}
  - {name: 123, sphere: 1}
  - {name: hulled, mesh: meshes/two.obj, mesh_as: hull}
  - {name: full, mesh: meshes/two.obj, mesh_as: solid}
  - {name: skin, mesh: meshes/two.obj, mesh_as: surface, scale: 2}
groups: {arm: [gripper, cup], things: [ball, pill, can]}
ignore: [[base, cup], [arm, arm], [things, base]]
)");
  const auto& bodies = scene.bodies();
  ASSERT_EQ(bodies.size(), 13u);
  EXPECT_EQ(bodies[0].name, "cup");
  EXPECT_EQ(bodies[0].parent, 2u);
  ASSERT_TRUE(bodies[0].pose);
  EXPECT_EQ(bodies[0].pose->translation.z, 0.5);
  EXPECT_TRUE(bodies[1].is_static);
  EXPECT_EQ(bodies[1].pose->qz, 0.5);
  EXPECT_EQ(bodies[1].source, "meshes/t.obj (hull)");
  ASSERT_EQ(bodies[1].parts.size(), 1u);
  double farthest = 0;
  for (const Vec3d& v : bodies[1].parts[0]->vertices) farthest = std::max(farthest, v.x);
  EXPECT_EQ(farthest, 2);
  ASSERT_EQ(bodies[2].parts.size(), 2u);
  EXPECT_EQ(bodies[2].parts[0]->radius, 0.25);
  EXPECT_EQ(bodies[2].parts[1]->vertices.size(), 4u);
  double lowest = 0;
  for (const Vec3d& v : bodies[2].parts[1]->vertices) lowest = std::min(lowest, v.y);
  EXPECT_EQ(lowest, -1);
  ASSERT_TRUE(bodies[2].display);
  double volume = 0;  // mirrored, and its faces reversed accordingly
  for (const auto& t : bodies[2].display->triangles) {
    const auto& v = bodies[2].display->vertices;
    volume += dot(v[t[0]], cross(v[t[1]], v[t[2]])) / 6;
  }
  EXPECT_NEAR(volume, 2 * 0.5 / 6, 1e-12);
  EXPECT_EQ(bodies[3].parts[0]->radius, 0.5);
  EXPECT_EQ(bodies[4].parts[0]->vertices.size(), 2u);
  EXPECT_EQ(bodies[5].model_error, 0);
  EXPECT_TRUE(is_round(*bodies[5].parts[0]));
  EXPECT_EQ(bodies[6].parts[0]->loaded_vertices, 5u);
  EXPECT_EQ(bodies[7].parts[0]->vertices.size(), 42u);
  EXPECT_EQ(bodies[8].parts[0]->half.x, bodies[8].parts[0]->half.z);
  EXPECT_EQ(bodies[9].name, "123");
  EXPECT_FALSE(surface_of(bodies[10]));
  ASSERT_TRUE(surface_of(bodies[11]) && surface_of(bodies[12]));
  EXPECT_TRUE(surface_of(bodies[11])->is_solid());
  EXPECT_EQ(surface_of(bodies[11])->parts().size(), 2u);
  EXPECT_FALSE(surface_of(bodies[12])->is_solid());
  EXPECT_NEAR(bodies[12].parts[0]->half.x, 6, 1e-13) << "both objects of the file, scaled";
  EXPECT_EQ(bodies[12].source, "meshes/two.obj (surface)");
  EXPECT_EQ(bodies[10].parts.size(), 1u);
  EXPECT_EQ(scene.groups()[scene.find_group("arm")].bodies, (std::vector<std::uint32_t>{0, 2}));
  using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;
  EXPECT_EQ(scene.ignored(), (Pairs{{0, 1}, {0, 2}, {1, 3}, {1, 4}, {1, 5}}));
}

TEST(SceneFile, SameMeshAndScaleShareTheirPart) {
  const TemporaryFolder folder;
  folder.write("t.obj", kTetrahedron);
  const engine::Scene scene = load_text(folder, R"(
bodies:
  - {name: a, mesh: t.obj, scale: 2}
  - {name: b, mesh: ./t.obj, scale: [2, 2, 2]}
  - {name: c, mesh: t.obj, scale: 2.0000001}
  - {name: d, mesh: t.obj, scale: 2, radius: 0.1}
  - {name: e, uv_sphere: {radius: 2, resolution: 5}}
  - {name: f, uv_sphere: {radius: 2, resolution: 5}}
)");
  const auto part = [&](const char* name) { return scene.bodies()[scene.find_body(name)].parts[0]; };
  EXPECT_EQ(part("a"), part("b"));
  EXPECT_NE(part("a"), part("c"));
  EXPECT_NE(part("a"), part("d"));
  EXPECT_EQ(part("e"), part("f"));
}

TEST(SceneFile, WhatIsNotKnownOfABodyIsRead) {
  const TemporaryFolder folder;
  const std::string plain = "bodies: [{name: a, box: 1, radius: 0.25}, {name: b, box: 1, radius: 0.25";
  const engine::Scene known = load_text(folder, plain + "}]");
  const engine::Scene scene =
      load_text(folder, plain + ", uncertainty: {position: 0.5, angle: 0.01}, padding: 0.125, max_speed: 2}]");
  const Body &a = scene.bodies()[0], &b = scene.bodies()[1];
  EXPECT_FALSE(has_uncertainty(a));
  EXPECT_FALSE(known.has_uncertainties());
  EXPECT_TRUE(scene.has_uncertainties());
  EXPECT_EQ(b.uncertainty.position, 0.5);
  EXPECT_EQ(b.uncertainty.angle, 0.01);
  EXPECT_EQ(b.max_speed, 2);
  EXPECT_NEAR(b.parts[0]->radius, 0.875, 1e-14);
  EXPECT_GT(b.model_inner, 0) << "the rounding of that sum";
  EXPECT_LT(b.model_inner, 1e-14);
  EXPECT_NEAR(b.reach, std::sqrt(0.75) + 0.875, 1e-12);
  EXPECT_NE(scene.revision(), known.revision());
  EXPECT_EQ(known.bodies()[0].parts[0], known.bodies()[1].parts[0]);
}

TEST(SceneFile, QuaternionsThatLookLikeXyzwAreWarnedOf) {
  const TemporaryFolder folder;
  folder.write("r.urdf", "<robot name='r'><link name='a'/></robot>");
  const engine::Scene scene = load_text(folder,
                                        "bodies:\n"
                                        "  - {name: a, box: 1, pose: [1, 2, 3, 0, 0, 0, 1]}\n"
                                        "  - {name: b, box: 1, pose: [0, 0, 0, 0, 0, 0.6, 0.8]}\n"
                                        "  - {name: c, box: 1, pose: [0, 0, 0, 0, 0, 0, -1]}\n"
                                        "  - {name: d, box: 1, pose: [0, 0, 0, 1, 0, 0, 0]}\n"
                                        "  - {name: e, box: 1, pose: [0, 0, 0, 0, 0, 1, 0]}\n"
                                        "  - {name: f, box: 1, pose: [0, 0, 0, 0, 0.6, 0, 0.8]}\n"
                                        "  - {name: g, box: 1, pose: [0, 0, 0, 0.8, 0, 0, 0.6]}\n"
                                        "  - {name: h, box: 1, pose: [0, 0, 0, 6.1e-17, 0, 0, 1]}\n"
                                        "robots: [{name: r, urdf: r.urdf, base: [0, 0, 0, 0, 0, 0, 1]}]\n");
  const std::string order = " looks like one in the order x, y, z, w, which would be ",
                    half =
                        "; in the order w, x, y, z, which counts, it is a half turn. If that is meant, write the same "
                        "rotation as 0, 0, ",
                    file = folder / "scene.yaml:";
  const std::string no_turn = "the quaternion 0, 0, 0, 1" + order + "no turn" + half + "0, -1";
  EXPECT_EQ(scene.warnings(), (std::vector<std::string>{file + "2: bodies[0].pose: " + no_turn,
                                                        file + "3: bodies[1].pose: the quaternion 0, 0, 0.6, 0.8" +
                                                            order + "a turn about z" + half + "-0.6, -0.8",
                                                        file + "10: robots[0].base: " + no_turn}));
}

// A wedge without symmetry, so that every wrong permutation or sign is detected.
constexpr const char* kWedge = "v 1 2 3\nv 4 2 3\nv 1 7 3\nv 1 2 14\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

TEST(SceneFile, UpYTurnsAMeshExactly) {
  const TemporaryFolder folder;
  folder.write("w.obj", kWedge);
  for (const std::string how : {"hull", "parts", "surface", "solid", "auto"}) {
    const engine::Scene scene = load_text(folder,
                                          "bodies:\n"
                                          "  - {name: y, mesh: w.obj, up: y, scale: [0.5, 1, -0.125], mesh_as: " +
                                              how +
                                              "}\n"
                                              "  - {name: z, mesh: w.obj, up: z, scale: [0.5, 1, -0.125], mesh_as: " +
                                              how +
                                              "}\n"
                                              "  - {name: none, mesh: w.obj, scale: [0.5, 1, -0.125], mesh_as: " +
                                              how + "}\n");
    const auto& b = scene.bodies();
    EXPECT_EQ(b[1].parts[0].get(), b[2].parts[0].get()) << "z is the default";
    std::vector<Vec3d> expected;
    for (const Vec3d& v : b[1].display->vertices) expected.push_back({v.x, 0 - v.z, v.y});
    const auto same = [](const Vec3d& a, const Vec3d& c) { return a.x == c.x && a.y == c.y && a.z == c.z; };
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), b[0].display->vertices.begin(),
                           b[0].display->vertices.end(), same))
        << how;
    EXPECT_EQ(b[0].display->triangles, b[1].display->triangles) << "a turn keeps the orientation of faces";
    EXPECT_EQ(b[0].model_error, b[1].model_error);
    ASSERT_EQ(b[0].parts.size(), 1u);
    ASSERT_EQ(b[0].parts[0]->vertices.size(), 4u);
    for (const Vec3d& v : b[0].parts[0]->vertices)
      EXPECT_TRUE(std::any_of(expected.begin(), expected.end(), [&](const Vec3d& e) { return same(e, v); })) << how;
  }
  EXPECT_EQ(error_text<engine::SceneError>([&] { load_text(folder, "bodies: [{name: a, mesh: w.obj, up: x}]"); }),
            folder / "scene.yaml:1: bodies[0].up: expected y or z, got \"x\"");
  EXPECT_EQ(error_text<engine::SceneError>([&] { load_text(folder, "bodies: [{name: a, box: 1, up: y}]"); }),
            folder / "scene.yaml:1: bodies[0].up: only a mesh has this key");
}

TEST(SceneFile, RandomBodiesRepeatBySeed) {
  const TemporaryFolder folder;
  const auto of = [&](const std::string& random) { return load_text(folder, "random: " + random); };
  const std::string shape = "shape: {uv_sphere: {radius: 2, resolution: 5}}";
  const engine::Scene a = of("{count: 100, " + shape + ", box: 60, seed: 7}");
  const engine::Scene b = of("{count: 1e2, " + shape + ", box: [60, 60, 60], seed: 7}");
  const engine::Scene c = of("{count: 100, " + shape + ", box: 60, seed: 8}");
  ASSERT_EQ(a.bodies().size(), 100u);
  EXPECT_EQ(a.bodies()[99].name, "random_99");
  EXPECT_EQ(a.bodies()[0].parts[0], a.bodies()[99].parts[0]);
  EXPECT_EQ(a.revision(), b.revision());
  EXPECT_NE(a.revision(), c.revision());
  EXPECT_EQ(a.revision(), 4296826941829119171u) << "the same scene gives the same number on any machine";
  const engine::Scene d =
      of("[{count: 2, shape: {sphere: 1}, box: 5, seed: 1, name: ball}, {count: 3, shape: {box: 1, radius: 0.1}, box: "
         "5, name: die, static: true}]");
  ASSERT_EQ(d.bodies().size(), 5u);
  EXPECT_EQ(d.bodies()[1].name, "ball_1");
  EXPECT_EQ(d.bodies()[4].name, "die_2");
  EXPECT_TRUE(d.bodies()[4].is_static);
}

TEST(SceneFile, FilesFromOutsideTheFolderOnlyWhenAllowed) {
  const TemporaryFolder folder;
  folder.write("outside.obj", kTetrahedron);
  const std::string scene = folder.write("inner/scene.yaml", "bodies: [{name: a, mesh: ../outside.obj}]");
  const std::string absolute =
      folder.write("inner/absolute.yaml", "bodies: [{name: a, mesh: " + (folder / "outside.obj") + "}]");
  std::filesystem::create_symlink(folder / "outside.obj", folder / "inner/link.obj");
  const std::string link = folder.write("inner/link.yaml", "bodies: [{name: a, mesh: link.obj}]");
  const std::string hint =
      "; mesh files must lie inside it unless others are allowed (--allow-outside; in Python allow_outside=True)";
  EXPECT_EQ(error_text<engine::SceneError>([&] { engine::Scene::load(scene); }),
            scene + ":1: bodies[0].mesh: \"../outside.obj\" leaves the scene's folder" + hint);
  EXPECT_EQ(error_text<engine::SceneError>([&] { engine::Scene::load(absolute); }),
            absolute + ":1: bodies[0].mesh: \"" + (folder / "outside.obj") +
                "\" is an absolute path, not one inside the scene's folder" + hint);
  EXPECT_EQ(error_text<engine::SceneError>([&] { engine::Scene::load(link); }),
            link + ":1: bodies[0].mesh: \"link.obj\" leaves the scene's folder through a symbolic link" + hint);
  for (const std::string& file : {scene, absolute, link})
    EXPECT_EQ(engine::Scene::load(file, true).bodies().size(), 1u);
  // A path may contain "..", and the folder itself may be reached through a link.
  folder.write("inner/meshes/t.obj", kTetrahedron);
  std::filesystem::create_directory_symlink(folder / "inner", folder / "alias");
  folder.write("inner/wander.yaml", "bodies: [{name: a, mesh: meshes/../meshes/t.obj}]");
  EXPECT_EQ(engine::Scene::load(folder / "alias/wander.yaml").bodies().size(), 1u);
}

}  // namespace
}  // namespace clearance
