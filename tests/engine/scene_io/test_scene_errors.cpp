// The scene file: the error for every kind of mistake.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "engine/scene/scene.h"
#include "tests/engine/scene_io/scene_text.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using test::kTetrahedron;
using test::load_text;

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
    const std::string got = error_text<engine::SceneError>([&] { load_text(folder, bad.yaml); });
    EXPECT_EQ(got.substr(0, (file + bad.error).size()), file + bad.error) << "for:\n" << bad.yaml << "\ngot: " << got;
  }
  EXPECT_EQ(load_text(folder, "bodies: [{name: a, sphere: 1}]").bodies().size(), 1u);  // and a good one after them
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
    const std::string text = error_text<engine::SceneError>([&] { load_text(folder, yaml); });
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
