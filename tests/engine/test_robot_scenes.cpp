// Parts of robots that a scene uses, and errors for unusable ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "engine/bvh/surface.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/evaluate_query.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using test::arm_scene;
using test::at_home;
using test::joints_of;

TEST(RobotInAScene, LinksAreBodiesAndTheBaseIsAFrame) {
  const engine::Scene scene = arm_scene(at_home());
  const std::uint32_t base = scene.find_body("arm"), shoulder = scene.find_body("arm/shoulder"),
                      fore = scene.find_body("arm/fore");
  ASSERT_NE(base, kNone);
  ASSERT_NE(shoulder, kNone);
  EXPECT_TRUE(scene.bodies()[base].parts.empty());
  EXPECT_TRUE(scene.bodies()[shoulder].parts.empty()) << "a link without shapes";
  EXPECT_EQ(scene.bodies()[fore].parts.size(), 1u);
  EXPECT_EQ(scene.bodies()[fore].parent, base);
  EXPECT_EQ(scene.joints().size(), 8u) << "the finger that mimics takes none";
  EXPECT_EQ(scene.joints()[scene.find_joint("arm/joint4")].upper, -0.07);
  EXPECT_EQ(joints_of(scene, "arm").size(), 8u);
  const engine::Engine engine(scene, test::kWithoutCovers);
  for (const BodyPair pair : engine.pairs({}))
    for (const std::uint32_t body : {pair.a, pair.b}) EXPECT_FALSE(scene.bodies()[body].parts.empty());
}

TEST(RobotInAScene, WithoutAnSrdfLinksThatAJointJoinsAreLeftOut) {
  const engine::Scene scene = arm_scene(at_home());
  const engine::Engine engine(scene, test::kWithoutCovers);
  const std::vector<BodyPair> pairs = engine.pairs({});
  const auto is_requested = [&](const char* a, const char* b) {
    std::uint32_t i = scene.find_body(a), j = scene.find_body(b);
    if (i > j) std::swap(i, j);
    return std::find(pairs.begin(), pairs.end(), BodyPair{i, j}) != pairs.end();
  };
  EXPECT_FALSE(is_requested("arm/upper", "arm/fore")) << "across the frame of the elbow";
  EXPECT_FALSE(is_requested("arm/palm", "arm/flange"));
  EXPECT_TRUE(is_requested("arm/base", "arm/fore"));
  EXPECT_TRUE(is_requested("arm/left_finger", "arm/right_finger"));
  EXPECT_TRUE(is_requested("table", "arm/palm"));
}

// The distance of links without a moving joint between them is constant: their pair is used only if an SRDF enables it.
TEST(RobotInAScene, APairWithoutAJointIsIncludedWhereTheSrdfEnablesIt) {
  const TemporaryFolder folder;
  const std::string ball = "<collision><geometry><sphere radius='1'/></geometry></collision></link>";
  const std::string urdf = folder.write(
      "r.urdf", "<robot name='r'><link name='a'>" + ball + "<link name='b'>" + ball + "<link name='c'>" + ball +
                    "<joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint>"
                    "<joint name='k' type='fixed'><parent link='a'/><child link='c'/></joint></robot>");
  const auto pairs = [&](const std::string& srdf) {
    engine::Scene scene;
    scene.add_robot("r", {.urdf = urdf, .srdf = folder.write("r.srdf", "<robot name='r'>" + srdf + "</robot>")});
    return engine::Engine(scene).pairs({});
  };
  EXPECT_TRUE(pairs("").empty());
  EXPECT_EQ(pairs("<enable_collisions link1='c' link2='a'/>"), (std::vector<BodyPair>{{1, 3}}));
}

TEST(RobotInAScene, SeveralShapesAreOneBodyEachWhereItsOriginSays) {
  const TemporaryFolder folder;
  const std::string urdf = folder.write("two.urdf", R"(<robot name="two"><link name="only">
    <collision><origin xyz="1 0 0" rpy="0 0 1.57079632679489661923"/><geometry><box size="0.2 0.4 0.6"/></geometry></collision>
    <collision><origin xyz="0 0 -2"/><geometry><sphere radius="0.5"/></geometry></collision></link></robot>)");
  engine::Scene scene;
  scene.add_robot("r", {.urdf = urdf, .padding = 0.125});
  const Body& body = scene.bodies()[scene.find_body("r/only")];
  ASSERT_EQ(body.parts.size(), 2u);
  double x = 0, y = 0;
  for (const Vec3d& v : body.parts[0]->vertices) x = std::max(x, v.x), y = std::max(y, v.y);
  EXPECT_NEAR(x, 1.2, 1e-15);
  EXPECT_NEAR(y, 0.1, 1e-15);
  EXPECT_EQ(body.parts[0]->radius, 0.125);
  EXPECT_EQ(body.parts[1]->vertices[0].z, -2);
  EXPECT_NEAR(body.parts[1]->radius, 0.625, 1e-15);
  EXPECT_GE(body.parts[1]->radius, 0.625) << "rounded up";
  EXPECT_EQ(body.padding, 0.125);
  EXPECT_GT(body.model_error, 0) << "a turned vertex is rounded";
  EXPECT_LT(body.model_error, 1e-15);
}

TEST(RobotInAScene, MeshesOfLinksAreWhatIsDeclaredOfThem) {
  const TemporaryFolder folder;
  folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const std::string urdf = folder.write("two.urdf", R"(<robot name="two"><link name="a">
    <collision><origin xyz="1 0 0" rpy="0.1 0 0"/><geometry><mesh filename="t.obj"/></geometry></collision>
    <collision><geometry><sphere radius="0.5"/></geometry></collision></link>
    <link name="b"><collision><geometry><mesh filename="t.obj"/></geometry></collision></link>
    <joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>)");
  engine::Scene scene;
  scene.add_robot("all", {.urdf = urdf, .mesh_as = MeshAs::kSolid, .padding = 0.25});
  scene.add_robot("one", {.urdf = urdf, .link_mesh_as = {{"b", MeshAs::kSurface}}});
  const auto link = [&](const char* name) -> const Body& { return scene.bodies()[scene.find_body(name)]; };
  ASSERT_EQ(link("all/a").parts.size(), 2u);
  const ConvexPart& moved = *link("all/a").parts[0];
  ASSERT_TRUE(moved.surface);
  EXPECT_TRUE(moved.surface->is_solid());
  EXPECT_EQ(moved.radius, 0.25);
  EXPECT_EQ(moved.surface->vertices()[0].x, 1);
  EXPECT_FALSE(link("all/a").parts[1]->surface);
  EXPECT_TRUE(surface_of(link("all/b"))->is_solid());
  EXPECT_FALSE(surface_of(link("one/a")));
  EXPECT_FALSE(surface_of(link("one/b"))->is_solid());
}

TEST(RobotInAScene, WhatIsWrongIsReportedWithItsPlace) {
  const TemporaryFolder folder;
  const auto text = [&](const std::string& urdf, engine::RobotOptions options = {}) {
    options.urdf = folder.write("r.urdf", urdf);
    engine::Scene scene;
    const std::string what = error_text<engine::SceneError>([&] { scene.add_robot("r", options); });
    EXPECT_TRUE(scene.bodies().empty()) << "nothing is left behind";
    return what;
  };
  const auto has = [](const std::string& what, const char* part) {
    EXPECT_NE(what.find(part), std::string::npos) << what;
  };
  const std::string mesh =
      "<robot name='r'><link name='a'><collision><geometry>\n<mesh filename='package://p/no.stl'/>"
      "</geometry></collision></link></robot>";
  has(text(mesh), "r.urdf:1: link \"a\": collision: mesh");
  has(text(mesh), "the package \"p\" has no folder here");
  has(text(mesh, {.urdf = "", .packages = {{"p", folder.path().string()}}}), "there is no file");
  has(text("<robot name='r'><link name='a'/><link name='b'/></robot>"), "r.urdf:");
  const std::string flat =
      "<robot name='r'><link name='a'><visual>\n<geometry><sphere radius='0'/></geometry></visual></link></robot>";
  has(text(flat, {.urdf = "", .visual = true}),
      "r.urdf:2: link \"a\": visual: geometry: sphere: radius: expected a number > 0, got \"0\"");
  const auto named = [](std::size_t bytes) {
    return "<robot name='r'><link name='" + std::string(bytes, 'n') + "'/></robot>";
  };
  engine::Scene longest;
  longest.add_robot("r", {.urdf = folder.write("long.urdf", named(61))});
  EXPECT_EQ(longest.bodies()[1].name.size(), 63u);
  has(text(named(62)), "robot \"r\": the link \"nnn");
  has(text(named(62)), " of 64 bytes; names have at most 63: shorten it in the robot's files");
  const std::string urdf = folder.write("long.urdf", named(50));
  has(error_text<engine::SceneError>([&] { engine::Scene().add_robot("robot_of_20_letters_", {.urdf = urdf}); }),
      "of 71 bytes; names have at most 63: name the robot by at most 12 bytes (name, in a scene file and of "
      "add_robot())");
  const std::string joint =
      "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='revolute'><parent link='a'/>"
      "<child link='b'/><limit lower='1' upper='2'/></joint></robot>";
  has(text(joint, {.urdf = "", .home = {{}}}), "home: \"j\" is not named, and 0 is beyond its limits");
  has(text(joint, {.urdf = "", .home = {{{"k", 1.0}}}}), "home: there is no joint \"k\"");
  has(text(joint, {.urdf = "", .home = {{{"j", std::numeric_limits<double>::quiet_NaN()}}}}),
      "home: \"j\": expected a number");
  has(text(joint, {.urdf = "", .parent = "table"}), "parent: there is no body \"table\"");
  has(text(joint, {.urdf = "", .home_state = "ready"}), "no group state \"ready\"");
  has(text(joint, {.urdf = "", .link_padding = {{"c", 0.1}}}), "padding: there is no link \"c\"");
  has(text(joint, {.urdf = "", .link_mesh_as = {{"c", MeshAs::kSolid}}}), "mesh_as: there is no link \"c\"");
  folder.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n");
  const std::string open =
      "<robot name='r'><link name='a'><collision><geometry>\n<mesh filename='open.obj'/>"
      "</geometry></collision></link></robot>";
  has(text(open, {.urdf = "", .mesh_as = MeshAs::kSolid}), "r.urdf:1: link \"a\": collision: ");
  has(text(open, {.urdf = "", .mesh_as = MeshAs::kSolid}),
      "open.obj: mesh_as: solid: the mesh encloses no volume: the edge from (0, 0, 0) to (0, 1, 0) of triangle 0");
  has(text(joint, {.urdf = "", .padding = -1}), "padding: expected a number of metres >= 0");
  has(text(joint, {.urdf = "", .link_uncertainty = {{"c", {}}}}), "uncertainty: there is no link \"c\"");
  const std::string ball =
      "<robot name='r'><link name='a'><collision><geometry><sphere radius='1'/></geometry></collision></link></robot>";
  has(text(ball, {.urdf = "", .link_uncertainty = {{"a", {-1, 0}}}}),
      "body \"r/a\": uncertainty.position: expected a number of metres >= 0, got -1");
  has(text(ball, {.urdf = "", .link_uncertainty = {{"a", {0, 7}}}}), "uncertainty.angle: expected 0 to 3.2 radians");
}

TEST(RobotInASceneFile, AUrdfIsASceneOfOneRobot) {
  const TemporaryFolder folder;
  folder.write("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const std::string urdf = folder.write("inner/file.xml",
                                        "\xEF\xBB\xBF\n <?xml version='1.0'?><robot name='panda'><link name='a'>"
                                        "<collision><geometry>\n<mesh filename='../far.obj'/></geometry></collision>"
                                        "</link></robot>");
  EXPECT_EQ(error_text<engine::SceneError>([&] { engine::Scene::load(urdf); }),
            urdf +
                ":2: link \"a\": collision: mesh \"../far.obj\" lies outside the scene's folder; mesh files must lie "
                "inside it unless others are allowed (--allow-outside; in Python allow_outside=True)");
  const engine::Scene scene = engine::Scene::load(urdf, true);
  ASSERT_EQ(scene.bodies().size(), 2u);
  EXPECT_EQ(scene.bodies()[0].name, "panda");
  EXPECT_EQ(scene.bodies()[1].name, "panda/a");
  const std::string bad = folder.write("bad.urdf", "<robot name='r'>\n<link/></robot>");
  EXPECT_EQ(error_text<engine::SceneError>([&] { engine::Scene::load(bad); }),
            bad + ":2: link: expected the attribute name");
  const std::string star = folder.write("star.urdf", "<robot name='*'><link name='a'/></robot>");
  EXPECT_TRUE(error_text<engine::SceneError>([&] {
                engine::Scene::load(star);
              }).starts_with(star + ": robot name \"*\" is reserved"));
}

TEST(RobotInASceneFile, TheContractsExampleAndItsErrors) {
  const TemporaryFolder folder;
  folder.write("arm.urdf",
               "<robot name='a'><link name='l0'/><link name='l1'><collision><geometry>"
               "<mesh filename='package://own/m/t.obj'/></geometry></collision></link><joint name='j' "
               "type='revolute'><parent link='l0'/><child link='l1'/><limit lower='-2' upper='2'/></joint></robot>");
  folder.write("m/t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  folder.write("far.srdf",
               "<robot name='a'><group_state name='up'><joint name='j' value='1e7'/></group_state></robot>");
  folder.write("arm.srdf",
               "<robot name='a'><group name='all'><joint name='j'/></group>"
               "<group_state name='up' group='all'><joint name='j' value='0.5'/></group_state></robot>");
  const std::string table =
      "bodies:\n  - {name: table, box: 1, static: true}\n  - {name: cup, sphere: 0.1, parent: p/l1}\n";
  const auto load = [&](const std::string& robot) {
    return engine::Scene::load(
        folder.write("scene.yaml", table + "robots:\n  - " + robot + "\nignore: [[p, table]]\n"));
  };
  const engine::Scene scene = load(
      "{name: p, urdf: arm.urdf, srdf: arm.srdf, packages: {own: .}, base: [0, 0, 0.7, 1, 0, 0, 0], "
      "parent: table, geometry: collision, home: up}");
  EXPECT_EQ(scene.bodies()[scene.find_body("p")].parent, scene.find_body("table"));
  EXPECT_EQ(scene.bodies()[scene.find_body("cup")].parent, scene.find_body("p/l1"));
  EXPECT_EQ(*scene.joints()[scene.find_joint("p/j")].home, 0.5);
  EXPECT_NE(scene.find_group("p/all"), kNone);
  EXPECT_EQ(joints_of(scene, "p/all").size(), 1u);
  EXPECT_EQ(engine::Engine(scene).pairs({}).size(), 1u)
      << "the cup and the table: a link's pair with the table is ignored";
  const auto has = [&](const std::string& robot, const char* part) {
    const std::string what = error_text<engine::SceneError>([&] { load(robot); });
    EXPECT_NE(what.find("scene.yaml:5"), std::string::npos) << what;
    EXPECT_NE(what.find(part), std::string::npos) << what;
  };
  has("{name: p, urdf: arm.urdf}", "arm.urdf:1: ");
  has("{name: p, urdf: none.urdf}", "robots[0].urdf");
  has("{name: p, urdf: ../arm.urdf}", "leaves the scene's folder");
  has("{name: p, urdf: arm.urdf, packages: {own: /}}", "is an absolute path");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, geometry: hull}", "expected collision or visual");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, home: {j: .nan}}", "robots[0].home.j");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, padding: -1}", "robots[0].padding");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, uncertainty: {l1: 0.1}}",
      "robots[0].uncertainty.l1: expected a map");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, uncertainty: {l1: {angle: -1}}}",
      "robots[0].uncertainty.l1.angle");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, parent: chair}",
      "robots[0].parent: body \"p\": parent: there is no");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, parent: p/l1}", "\"p/l1\" follows \"p\" itself");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, static: true, requires_pose: true}",
      "a static body never gets another pose");
  has("{name: p, urdf: arm.urdf, packages: {own: .}, base: [0, 0, 0, 0, 0, 0, 0]}", "robots[0].base");
  has("{name: p, urdf: arm.urdf, srdf: far.srdf, home: up, packages: {own: .}}",
      "home: \"j\": expected a number from -1e6 to 1e6, got 10000000");
  has("{name: p, urdf: arm.urdf, srdf: m/t.obj, packages: {own: .}}", "m/t.obj:9: invalid XML");
  has("{name: table, urdf: arm.urdf, packages: {own: .}}", "already that of a body");
  has("{name: p, urdf: arm.urdf, baze: 1}", "baze");
}

}  // namespace
}  // namespace clearance
