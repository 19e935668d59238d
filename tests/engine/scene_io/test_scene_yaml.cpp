// The scene file: the meaning of each key, and the error for every kind of mistake.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "engine/bvh/surface.h"
#include "engine/hull/primitive.h"
#include "engine/scene/scene.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

constexpr const char* kTetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
constexpr const char* kTwoObjects =
    "o first\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    "o second\nv 5 0 0\nv 6 0 0\nv 5 1 0\nv 5 0 1\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n";

engine::Scene load(const TemporaryFolder& folder, const std::string& yaml, bool allow_outside = false) {
  return engine::Scene::load(folder.write("scene.yaml", yaml), allow_outside);
}

TEST(SceneFile, EveryKeyOfABody) {
  const TemporaryFolder folder;
  folder.write("meshes/t.obj", kTetrahedron);
  folder.write("meshes/two.obj", kTwoObjects);
  const engine::Scene scene = load(folder, R"(
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
  const engine::Scene scene = load(folder, R"(
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
  const engine::Scene known = load(folder, plain + "}]");
  const engine::Scene scene =
      load(folder, plain + ", uncertainty: {position: 0.5, angle: 0.01}, padding: 0.125, max_speed: 2}]");
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
  const engine::Scene scene = load(folder,
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
    const engine::Scene scene = load(folder,
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
  EXPECT_EQ(error_text<engine::SceneError>([&] { load(folder, "bodies: [{name: a, mesh: w.obj, up: x}]"); }),
            folder / "scene.yaml:1: bodies[0].up: expected y or z, got \"x\"");
  EXPECT_EQ(error_text<engine::SceneError>([&] { load(folder, "bodies: [{name: a, box: 1, up: y}]"); }),
            folder / "scene.yaml:1: bodies[0].up: only a mesh has this key");
}

TEST(SceneFile, RandomBodiesRepeatBySeed) {
  const TemporaryFolder folder;
  const auto of = [&](const std::string& random) { return load(folder, "random: " + random); };
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

// A wrong scene file, and the error after its path.
struct BadScene {
  const char* yaml;
  const char* error;
};

const BadScene kBadScenes[] = {
    {"", ": the file is empty; expected a map with the key \"bodies\""},
    {"# nothing but a comment\n", ": the file is empty; expected a map with the key \"bodies\""},
    {"bodies: []", ":1: expected at least one body, under \"bodies\", \"random\" or \"robots\""},
    {"- a\n- b\n", ":1: expected a map with the key \"bodies\", got a list of 2"},
    {"hello", ":1: expected a map with the key \"bodies\", got \"hello\""},
    {"bodies: {a: 1}", ":1: bodies: expected a list of bodies, got a map"},
    {"bodies:\n  - ball\n", ":2: bodies[0]: expected a body, such as {name: table, box: [1, 1, 0.1]}, got \"ball\""},
    {"bodies:\n  - {sphere: 1}\n", ":2: bodies[0]: expected the key \"name\""},
    {"bodies:\n  - {name: a}\n",
     ":2: bodies[0]: expected one of the keys mesh, box, sphere, capsule, cylinder, cone, ellipsoid, half_space, "
     "points, uv_sphere"},
    {"bodies:\n  - name: a\n    sphere: 1\n    box: 1\n",
     ":3: bodies[0].sphere: a body has one geometry, and \"box\" is there already"},
    {"bodies: [{name: a, sphere: -1}]", ":1: bodies[0].sphere: expected a number > 0, got -1"},
    {"bodies: [{name: a, sphere: big}]", ":1: bodies[0].sphere: expected a number > 0, got \"big\""},
    {"bodies: [{name: a, sphere: \"1\"}]", ":1: bodies[0].sphere: expected a number > 0, got \"1\""},
    {"bodies: [{name: a, sphere: .nan}]", ":1: bodies[0].sphere: expected a number > 0, got \".nan\""},
    {"bodies: [{name: a, sphere: inf}]", ":1: bodies[0].sphere: expected a number > 0, got \"inf\""},
    {"bodies: [{name: a, sphere: 1e999}]", ":1: bodies[0].sphere: expected a number > 0, got \"1e999\""},
    {"bodies: [{name: a, sphere: 0x10}]", ":1: bodies[0].sphere: expected a number > 0, got \"0x10\""},
    {"bodies: [{name: a, sphere: 1e61}]", ":1: bodies[0].sphere: radius must be a number of metres >= 0"},
    {"bodies: [{name: a, sphere: }]", ":1: bodies[0].sphere: expected a number > 0, got nothing"},
    {"bodies: [{name: a, box: [1, 1]}]",
     ":1: bodies[0].box: expected an edge length, or 3 of them [x, y, z], got a list of 2"},
    {"bodies: [{name: a, box: [1, 1, 0]}]", ":1: bodies[0].box[2]: expected a number > 0, got 0"},
    {"bodies: [{name: a, capsule: 1}]", ":1: bodies[0].capsule: expected 2 numbers [radius, length], got 1"},
    {"bodies: [{name: a, cone: [1, 0]}]", ":1: bodies[0].cone[1]: expected a number > 0, got 0"},
    {"bodies: [{name: a, ellipsoid: [1, 2]}]",
     ":1: bodies[0].ellipsoid: expected 3 half axes [x, y, z], got a list of 2"},
    {"bodies: [{name: a, box: 1}, {name: f, half_space: true, parent: a}]",
     ":1: bodies[1].parent: body \"f\": parent: a half_space cannot follow a body: only its own pose places it"},
    {"bodies: [{name: a, cylinder: [1, 0]}]", ":1: bodies[0].cylinder[1]: expected a number > 0, got 0"},
    {"bodies: [{name: a, points: [[0, 0, 0], [0, 0]]}]",
     ":1: bodies[0].points[1]: expected a point [x, y, z], got a list of 2"},
    {"bodies:\n- name: a\n  points:\n  - [0, 0, 0]\n  - [0, x, 0]\n",
     ":5: bodies[0].points[1][1]: expected a number, got \"x\""},
    {"bodies: [{name: a, uv_sphere: {radius: 1}}]", ":1: bodies[0].uv_sphere: expected the key \"resolution\""},
    {"bodies: [{name: a, uv_sphere: {radius: 1, resolution: 1e9}}]",
     ":1: bodies[0].uv_sphere.resolution: expected an integer from 2 to 2000, got 1e9"},
    {"bodies: [{name: a, uv_sphere: {radius: 1, resolution: 5.5}}]",
     ":1: bodies[0].uv_sphere.resolution: expected an integer from 2 to 2000, got 5.5"},
    {"bodies:\n- {name: a, uv_sphere: {radius: 1, resolution: 2000}}\n- {name: b, uv_sphere: {radius: 2, resolution: "
     "2000}}\n"
     "- {name: c, uv_sphere: {radius: 3, resolution: 2000}}\n",
     ":4: bodies[2].uv_sphere: the uv_spheres of this scene have more than 20000000 vertices"},
    {"bodies: [{name: a, sphere: 1, radius: -1}]", ":1: bodies[0].radius: expected a number >= 0, got -1"},
    {"bodies: [{name: a, sphere: 1, radious: 1}]", ":1: bodies[0]: unknown key \"radious\"; did you mean \"radius\"?"},
    {"bodies: [{name: a, sphere: 1}]\nbodys: []", ":2: unknown key \"bodys\"; did you mean \"bodies\"?"},
    {"bodies: [{name: a, sphere: 1}]\nquaternions: []",
     ":2: unknown key \"quaternions\"; known: bodies, groups, ignore, random, robots"},
    {"bodies: [{name: a, sphere: 1, sphere: 2}]", ":1: bodies[0]: the key \"sphere\" occurs twice"},
    {"bodies: [{name: a, sphere: 1, [x]: 2}]", ":1: bodies[0]: expected a text as key, got a list of 1"},
    {"bodies: [{name: a, sphere: 1, static: yes}]", ":1: bodies[0].static: expected true or false, got \"yes\""},
    {"bodies: [{name: a, sphere: 1, scale: 2}]", ":1: bodies[0].scale: only a mesh has this key"},
    {"bodies: [{name: [a], sphere: 1}]", ":1: bodies[0].name: expected a name, got a list of 1"},
    {"bodies: [{name: \"\", sphere: 1}]", ":1: bodies[0].name: body name is empty"},
    {"bodies: [{name: \"*\", sphere: 1}]", ":1: bodies[0].name: body name \"*\" is reserved: it selects every body"},
    {"bodies: [{name: \"a\\tb\", sphere: 1}]",
     ":1: bodies[0].name: body name holds an unprintable character or bad UTF-8 at byte 1"},
    {"bodies: [{name: a123456789b123456789c123456789d123456789e123456789f123456789g123, sphere: 1}]",
     ":1: bodies[0].name: body name has 64 bytes, expected at most 63: "
     "\"a123456789b123456789c123456789d123456789\"..."},
    {"bodies:\n- {name: a, sphere: 1}\n- {name: a, sphere: 1}\n",
     ":3: bodies[1].name: body name \"a\" is already that of a body"},
    {"bodies: [{name: a, sphere: 1, pose: [0, 0, 0, 1, 0, 0]}]",
     ":1: bodies[0].pose: expected 7 numbers [x, y, z, qw, qx, qy, qz], got a list of 6"},
    {"bodies: [{name: a, sphere: 1, pose: [0, 0, 0, 0, 0, 0, 0]}]",
     ":1: bodies[0].pose: expected a quaternion (qw, qx, qy, qz) of norm 1e-6 to 1e6 and coordinates up to 1e60 m"},
    {"bodies: [{name: a, sphere: 1, pose: [0, 0, 0, .nan, 0, 0, 0]}]",
     ":1: bodies[0].pose[3]: expected a number, got \".nan\""},
    {"bodies: [{name: a, sphere: 1, pose: [1e61, 0, 0, 1, 0, 0, 0]}]",
     ":1: bodies[0].pose: expected a quaternion (qw, qx, qy, qz) of norm 1e-6 to 1e6 and coordinates up to 1e60 m"},
    {"bodies:\n- name: a\n  sphere: 1\n  parent: b\n",
     ":4: bodies[0].parent: body \"a\": parent: there is no body \"b\""},
    {"bodies: [{name: a, sphere: 1, parent: a}]",
     ":1: bodies[0].parent: body \"a\": parent: \"a\" follows \"a\" itself"},
    {"bodies:\n- {name: a, sphere: 1, parent: b}\n- {name: b, sphere: 1, parent: c}\n- {name: c, sphere: 1, parent: "
     "a}\n",
     ":4: bodies[2].parent: body \"c\": parent: \"a\" follows \"c\" itself"},
    {"bodies:\n- {name: a, sphere: 1}\n- {name: b, sphere: 1, parent: a, static: true}\n",
     ":3: bodies[1].parent: body \"b\": a static body cannot follow the movable body \"a\""},
    {"bodies: [{name: a, mesh: none.obj}]", ":1: bodies[0].mesh: \"none.obj\": No such file or directory"},
    {"bodies: [{name: a, mesh: \"\"}]", ":1: bodies[0].mesh: expected the path of a mesh file, got \"\""},
    {"bodies: [{name: a, mesh: [x]}]", ":1: bodies[0].mesh: expected the path of a mesh file, got a list of 1"},
    {"bodies: [{name: a, mesh: t.obj, scale: 0}]", ":1: bodies[0].scale: expected factors other than 0"},
    {"bodies: [{name: a, mesh: t.obj, scale: [1, 2]}]",
     ":1: bodies[0].scale: expected a number, or 3 of them [sx, sy, sz], got a list of 2"},
    {"bodies: [{name: a, mesh: t.obj, scale: 1e61}]",
     ":1: bodies[0].mesh: t.obj: scale: expected finite numbers other than 0"},
    {"bodies: [{name: a, mesh: t.obj, mesh_as: hulls}]",
     ":1: bodies[0].mesh_as: expected auto, hull, parts, surface or solid, got \"hulls\""},
    {"bodies: [{name: a, mesh: open.obj, mesh_as: decompose}]",
     ":1: bodies[0].mesh_as: expected auto, hull, parts, surface or solid, got \"decompose\""},
    {"bodies: [{name: a, mesh: open.obj, mesh_as: solid}]",
     ":1: bodies[0].mesh: open.obj: mesh_as: solid: the mesh encloses no volume: the edge from (0, 0, 0) to (0, 1, "
     "0) "
     "of triangle 0 belongs to no other triangle: the mesh is open there"},
    {"bodies: [{name: a, box: 1, mesh_as: solid}]", ":1: bodies[0].mesh_as: only a mesh has this key"},
    {"bodies: [{name: a, mesh: empty.obj}]", ":1: bodies[0].mesh: empty.obj: the file is empty"},
    {"bodies: [{name: a, sphere: 1, uncertainty: 0.1}]",
     ":1: bodies[0].uncertainty: expected a map, such as {position: 0.002, angle: 0.01}, got 0.1"},
    {"bodies: [{name: a, sphere: 1, uncertainty: {postion: 1}}]",
     ":1: bodies[0].uncertainty: unknown key \"postion\"; did you mean \"position\"?"},
    {"bodies: [{name: a, sphere: 1, uncertainty: {position: -1}}]",
     ":1: bodies[0].uncertainty.position: expected a number >= 0, got -1"},
    {"bodies: [{name: a, sphere: 1, uncertainty: {angle: .inf}}]",
     ":1: bodies[0].uncertainty.angle: expected a number >= 0, got \".inf\""},
    {"bodies: [{name: a, sphere: 1, uncertainty: {angle: 30}}]",
     ":1: bodies[0].name: body \"a\": uncertainty.angle: expected 0 to 3.2 radians, got 30"},
    {"bodies: [{name: a, sphere: 1, padding: -0.5}]", ":1: bodies[0].padding: expected a number >= 0, got -0.5"},
    {"bodies: [{name: a, sphere: 1, max_speed: fast}]",
     ":1: bodies[0].max_speed: expected a number >= 0, got \"fast\""},
    {"bodies: [{name: a, sphere: 1}]\ngroups: [a]",
     ":2: groups: expected a map of names to lists of bodies, got a list of 1"},
    {"bodies: [{name: a, sphere: 1}]\ngroups: {g: a}", ":2: groups.g: expected a list of bodies, got \"a\""},
    {"bodies: [{name: a, sphere: 1}]\ngroups: {g: {requires_pose: true}}", ":2: groups.g: expected the key \"bodies\""},
    {"bodies: [{name: a, sphere: 1}]\ngroups: {g: {bodies: [a], require_pose: true}}",
     ":2: groups.g: unknown key \"require_pose\"; did you mean \"requires_pose\"?"},
    {"bodies: [{name: a, sphere: 1}]\ngroups: {g: {bodies: [a], requires_pose: 1}}",
     ":2: groups.g.requires_pose: expected true or false, got 1"},
    {"bodies: [{name: a, sphere: 1, static: true}]\ngroups: {g: {bodies: [a], requires_pose: true}}",
     ":2: groups.g: body \"a\": requires_pose: a static body never gets another pose than its own"},
    {"bodies: [{name: a, sphere: 1, requires_pose: true, static: true}]",
     ":1: bodies[0].name: body \"a\": requires_pose: a static body never gets another pose than its own"},
    {"bodies: [{name: a, sphere: 1}]\ngroups: {g: [a, b]}", ":2: groups.g[1]: there is no body \"b\""},
    {"bodies: [{name: a, sphere: 1}]\ngroups: {a: [a]}", ":2: groups.a: group name \"a\" is already that of a body"},
    {"bodies: [{name: a, sphere: 1}]\nignore: [a]",
     ":2: ignore[0]: expected a pair [body or group, body or group], got \"a\""},
    {"bodies: [{name: a, sphere: 1}]\nignore: [[a]]",
     ":2: ignore[0]: expected a pair [body or group, body or group], got a list of 1"},
    {"bodies: [{name: a, sphere: 1}]\nignore: [[a, z]]", ":2: ignore[0]: there is no body or group \"z\""},
    {"bodies: [{name: table, sphere: 1}]\ngroups: {g: [tabel]}",
     ":2: groups.g[0]: there is no body \"tabel\"; did you mean \"table\"?"},
    {"bodies: [{name: table, sphere: 1}]\ngroups: {rigid: [table]}\nignore: [[table, riged]]",
     ":3: ignore[0]: there is no body or group \"riged\"; did you mean \"rigid\"?"},
    {"bodies: [{name: table, sphere: 1}, {name: b, sphere: 1, parent: \"table \"}]",
     ":1: bodies[1].parent: body \"b\": parent: there is no body \"table \"; did you mean \"table\"?"},
    {"bodies: [{name: a, sphere: 1}]\nignore: [[a, a]]",
     ":2: ignore[0]: ignore: \"a\" with itself: a body has no pair with itself"},
    {"random: {count: 1e12, shape: {sphere: 1}, box: 1}",
     ":1: random.count: expected an integer from 1 to 1000000, got 1e12"},
    {"random: {count: 2.5, shape: {sphere: 1}, box: 1}",
     ":1: random.count: expected an integer from 1 to 1000000, got 2.5"},
    {"random: [{count: 600000, shape: {sphere: 1}, box: 1, name: a}, {count: 600000, shape: {sphere: 1}, box: 1, name: "
     "b}]",
     ":1: random[1]: more than 1000000 bodies in one scene"},
    {"random: {shape: {sphere: 1}, box: 1}", ":1: random: expected the key \"count\""},
    {"random: {count: 2, shape: {sphere: 1, attitude: [0]}, box: 1}",
     ":1: random.shape: unknown key \"attitude\"; known: mesh, box, sphere, capsule, cylinder, cone, ellipsoid, "
     "points, uv_sphere"},
    {"random: {count: 2, shape: sphere, box: 1}",
     ":1: random.shape: expected a shape, such as {sphere: 0.1}, got \"sphere\""},
    {"random: {count: 2, shape: {sphere: 1}, box: -1}", ":1: random.box: expected a number > 0, got -1"},
    {"random: {count: 2, shape: {sphere: 1}, box: 1, seed: -1}",
     ":1: random.seed: expected an integer from 0 to 18446744073709551615, got -1"},
    {"bodies: [{name: a, sphere: 1}\n", ":2: not valid YAML: end of sequence flow not found"},
    {"bodies: [{name: a, sphere: 1}]\n\t- x\n", ":2: not valid YAML: "},
    {"bodies: *nothing\n", ":1: not valid YAML: the referenced anchor is not defined"},
    {"a: 1\n---\nb: 2\n", ":2: a second YAML document begins; expected one"},
    {"bodies: &x [*x]\n", ":1: an alias inside its own anchor"},
};

TEST(SceneFile, EveryMistakeIsNamedWithItsPlace) {
  const TemporaryFolder folder;
  folder.write("t.obj", kTetrahedron);
  folder.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n");
  folder.write("empty.obj", "");
  const std::string file = folder / "scene.yaml";
  for (const BadScene& bad : kBadScenes) {
    const std::string got = error_text<engine::SceneError>([&] { load(folder, bad.yaml); });
    EXPECT_EQ(got.substr(0, (file + bad.error).size()), file + bad.error) << "for:\n" << bad.yaml << "\ngot: " << got;
  }
  EXPECT_EQ(load(folder, "bodies: [{name: a, sphere: 1}]").bodies().size(), 1u);  // and a good one after them
}

TEST(SceneFile, FilesThatAreNoSceneFile) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& path) {
    return error_text<engine::SceneError>([&] { engine::Scene::load(path); });
  };
  EXPECT_EQ(error(folder / "none.yaml"), folder / "none.yaml: No such file or directory");
  EXPECT_EQ(error(folder.path().string()), folder.path().string() + ": expected a scene file, got a folder");
  EXPECT_EQ(error("/dev/zero"), "/dev/zero: expected a scene file, got a device, pipe or socket");
  EXPECT_EQ(error(folder.write("zero.yaml", std::string("bodies:\n  - {name: \0a}", 22))),
            folder / "zero.yaml:2: not a text file: it holds a zero byte");
  std::ofstream(folder / "huge.yaml").close();
  std::filesystem::resize_file(folder / "huge.yaml", std::uintmax_t{1} << 40);
  EXPECT_EQ(error(folder / "huge.yaml"),
            folder / "huge.yaml: 1099511627776 bytes; a scene file may have at most 67108864");
}

TEST(SceneFile, FilesMadeToExhaustAreRejectedSoon) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& yaml) {
    const std::string text = error_text<engine::SceneError>([&] { load(folder, yaml); });
    return text.substr(std::min(text.size(), (folder / "scene.yaml").size()));
  };
  // A billion laughs: each level names the one before nine times.
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i) {
    const std::string name = std::to_string(i), below = std::to_string(i - 1);
    laughs.append("a").append(name).append(": &a").append(name).append(" [*a").append(below);
    for (int k = 0; k < 8; ++k) laughs.append(", *a").append(below);
    laughs += "]\n";
  }
  EXPECT_EQ(error(laughs + "bodies: *a11\n"), ":1: unknown key \"a0\"; known: bodies, groups, ignore, random, robots");
  // The same points for ten thousand bodies, through an alias.
  std::string many = "bodies:\n  - {name: a, points: &p [";
  for (int i = 0; i < 20000; ++i) many += "[0, 0, 0], ";
  many += "[1, 1, 1]]}\n";
  for (int i = 0; i < 10000; ++i) many += "  - {name: b" + std::to_string(i) + ", points: *p}\n";
  EXPECT_EQ(error(many).substr(0, 150),
            ":251: bodies[249].points: too many values, aliases counted each time they are used");
  EXPECT_EQ(error("bodies: " + std::string(100, '[') + std::string(100, ']')), ":1: nested deeper than 32 levels");
  EXPECT_EQ(error("bodies: " + std::string(200000, '[')), ":1: nested deeper than 32 levels");
  EXPECT_EQ(error("bodies: [" +
                  [] {
                    std::string s;
                    for (int i = 0; i < 2'550'000; ++i) s += "a,";
                    return s;
                  }() +
                  "]"),
            ":1: more than 2500000 values in one scene file");
}

}  // namespace
}  // namespace clearance
