// Robots from files: a small one with every kind of joint.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/robot/robot.h"
#include "tests/source_file.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

const std::string kFolder = source_file("tests/engine/robot/");

RobotModel every_joint() {
  return read_urdf(kFolder + "every_joint.urdf");
}

TEST(Robot, JointsStandInTheOrderOfTheTree) {
  const RobotModel robot = every_joint();
  EXPECT_EQ(robot.name, "every_joint");
  EXPECT_EQ(robot.links[robot.base].name, "base");
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints) names.push_back(joint.name);
  EXPECT_EQ(names, (std::vector<std::string>{"drive", "turn", "lift", "roll", "mount", "grip_left", "grip_right",
                                             "let_go", "lid"}));
  for (std::uint32_t j = 0; j < robot.joints.size(); ++j) {
    EXPECT_EQ(robot.links[robot.joints[j].child].joint, j);
    const std::uint32_t carrier = robot.links[robot.joints[j].parent].joint;
    EXPECT_TRUE(carrier == kNone || carrier < j);
  }
  std::vector<std::string> chain;
  for (const std::uint32_t j : robot.chain_to(robot.find_link("right_finger"))) chain.push_back(robot.joints[j].name);
  EXPECT_EQ(chain, (std::vector<std::string>{"drive", "turn", "lift", "roll", "mount", "grip_right"}));
  EXPECT_TRUE(robot.chain_to(robot.base).empty());
}

TEST(Robot, ColumnsAreThePositionsThatJointsTake) {
  const RobotModel robot = every_joint();
  std::vector<std::string> names;
  for (const RobotColumn& column : robot.columns) names.push_back(column.name);
  EXPECT_EQ(names,
            (std::vector<std::string>{"drive/x", "drive/y", "drive/theta", "turn", "lift", "roll", "grip_left"}));
  EXPECT_EQ(robot.columns[robot.find_column("turn")].lower, -2.8973);
  EXPECT_EQ(robot.columns[robot.find_column("turn")].upper, 2.8973);
  EXPECT_EQ(robot.columns[robot.find_column("roll")].upper, INFINITY);
  EXPECT_EQ(robot.joints[robot.find_joint("drive")].column, 0u);
  EXPECT_EQ(robot.joints[robot.find_joint("mount")].column, kNone);
  EXPECT_EQ(robot.joints[robot.find_joint("let_go")].column, kNone);
  const RobotJoint& mimic = robot.joints[robot.find_joint("grip_right")];
  EXPECT_EQ(mimic.column, kNone);
  ASSERT_TRUE(mimic.mimic);
  EXPECT_EQ(mimic.mimic->joint, robot.find_joint("grip_left"));
  EXPECT_EQ(mimic.mimic->multiplier, -1);
  EXPECT_EQ(mimic.mimic->offset, 1e-3);
  EXPECT_FALSE(robot.joints[robot.find_joint("mount")].mimic) << "on a fixed joint it means nothing";
}

TEST(Robot, NumbersAreTheNearestToTheirDecimals) {
  const RobotModel robot = every_joint();
  const RobotJoint& turn = robot.joints[robot.find_joint("turn")];
  EXPECT_EQ(turn.X_pj.xyz.z, 0.3);
  EXPECT_EQ(turn.X_pj.rpy.y, -1.57079632679);
  EXPECT_EQ(turn.X_pj.rpy.z, 3.1415926535897931);
  EXPECT_EQ(turn.axis.z, -2) << "as it stands; normalised in reals later";
  EXPECT_EQ(robot.joints[robot.find_joint("roll")].axis.x, 1) << "URDF's own default";
  EXPECT_EQ(robot.joints[robot.find_joint("let_go")].X_pj.xyz.x, 0);
}

TEST(Robot, LinksKeepAllTheirShapes) {
  const RobotModel robot = every_joint();
  const RobotLink& hand = robot.links[robot.find_link("hand")];
  ASSERT_EQ(hand.collision.size(), 2u);
  EXPECT_EQ(hand.collision[0].kind, RobotShape::Kind::kBox);
  EXPECT_EQ(hand.collision[0].size.y, 0.2);
  EXPECT_EQ(hand.collision[0].X_ls.rpy.y, 1.5);
  EXPECT_EQ(hand.collision[1].radius, 0.03);
  ASSERT_EQ(hand.visual.size(), 1u);
  EXPECT_EQ(hand.visual[0].mesh_scale.z, -0.001);
  EXPECT_EQ(robot.links[robot.find_link("shoulder")].collision[0].length, 0.4);
  EXPECT_TRUE(robot.links[robot.find_link("wheel")].collision.empty());
}

TEST(Robot, MeshesLieInTheUrdfsFolderOrInPackages) {
  const TemporaryFolder files;
  for (const char* name : {"slide.stl", "sub/hand.dae"}) files.write(name, "x");
  const std::string folder = files.path();
  const RobotModel robot = every_joint();
  const RobotShape& slide = robot.links[robot.find_link("slide")].collision[0];
  const RobotShape& hand = robot.links[robot.find_link("hand")].visual[0];
  EXPECT_EQ(mesh_path(slide, folder, {}), folder + "/slide.stl");
  EXPECT_EQ(mesh_path(hand, "", {{"every_joint", folder + "/sub"}}), folder + "/sub/hand.dae");
  RobotShape doubled = hand;
  doubled.mesh = "package://every_joint//hand.dae";
  EXPECT_EQ(mesh_path(doubled, "", {{"every_joint", folder + "/sub"}}), folder + "/sub/hand.dae") << "not /hand.dae";
  RobotShape absolute = slide;
  absolute.mesh = "file://" + folder + "/slide.stl";
  EXPECT_EQ(mesh_path(absolute, "elsewhere", {}), folder + "/slide.stl");
}

TEST(Robot, EscapesOfUrisAreRead) {
  const std::string folder = testing::TempDir() + "clearance_robot_uris";
  std::filesystem::create_directories(folder + "/my parts");
  for (const char* name : {"/my parts/a.stl", "/50%.stl", "/b%20c.stl"}) std::ofstream(folder + name) << "x";
  const auto path = [&](const std::string& named) {
    RobotShape shape;
    shape.mesh = named;
    return mesh_path(shape, folder, {{"p", folder}});
  };
  EXPECT_EQ(path("file://" + folder + "/my%20parts/a.stl"), folder + "/my parts/a.stl");
  EXPECT_EQ(path("file://localhost" + folder + "/my parts/%61.stl"), folder + "/my parts/a.stl");
  EXPECT_EQ(path("package://p/my%20parts/a.stl"), folder + "/my parts/a.stl");
  EXPECT_EQ(path("package:///p/my%20parts/a.stl"), folder + "/my parts/a.stl") << "a slash too many";
  EXPECT_EQ(path("file://" + folder + "/50%.stl"), folder + "/50%.stl") << "no escape";
  EXPECT_EQ(path("file://" + folder + "/b%20c.stl"), folder + "/b%20c.stl") << "a file of that name, and no other";
  EXPECT_EQ(path("b%20c.stl"), folder + "/b%20c.stl") << "a path is no URI";
}

TEST(Robot, PackagesAreFoundByTheEnvironmentOfRos) {
  const std::string home = testing::TempDir() + "clearance_robot_packages";
  std::filesystem::remove_all(home);
  const auto write = [&](const std::string& file, const std::string& text) {
    const std::filesystem::path path = home + "/" + file;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  };
  write("prefix/share/of_ament/meshes/a.stl", "x");
  write("ws/src/repository/folder/package.xml", "<package><name> of_ros </name></package>");
  write("ws/src/repository/folder/inner/package.xml", "<package><name>inside</name></package>");
  write("ws/src/old/manifest.xml", "<package/>");
  write("ws/src/left_out/CATKIN_IGNORE", "");
  write("ws/src/left_out/package.xml", "<package><name>left_out</name></package>");
  write("alone/package.xml", "<package><name>alone</name></package>");
  std::string links, joints;
  for (const char* name : {"of_ament", "of_ros", "inside", "old", "left_out", "alone", "named", "nowhere"}) {
    links += "<link name='" + std::string(name) + "'><collision><geometry><mesh filename='package://" + name +
             "/meshes/a.stl'/></geometry></collision></link>";
    if (joints.empty())
      joints = " ";
    else
      joints += "<joint name='" + std::string(name) + "' type='fixed'><parent link='of_ament'/><child link='" + name +
                "'/></joint>";
  }
  const RobotModel robot = parse_urdf("<robot name='r'>" + links + joints + "</robot>", "r.urdf");
  ::setenv("AMENT_PREFIX_PATH", (home + "/none:" + home + "/prefix").c_str(), 1);
  ::setenv("ROS_PACKAGE_PATH", (home + "/ws/src::" + home + "/alone").c_str(), 1);
  std::map<std::string, std::string> packages = {{"named", "/by/hand"}}, visual;
  find_packages(robot, false, &packages);
  find_packages(robot, true, &visual);
  ::unsetenv("AMENT_PREFIX_PATH");
  ::unsetenv("ROS_PACKAGE_PATH");
  EXPECT_EQ(packages, (std::map<std::string, std::string>{{"alone", home + "/alone"},
                                                          {"named", "/by/hand"},
                                                          {"of_ament", home + "/prefix/share/of_ament"},
                                                          {"of_ros", home + "/ws/src/repository/folder"},
                                                          {"old", home + "/ws/src/old"}}));
  EXPECT_TRUE(visual.empty());
  EXPECT_EQ(mesh_path(robot.links[0].collision[0], "", packages), home + "/prefix/share/of_ament/meshes/a.stl");
}

std::string turning(const char* name, const char* parent, const char* child, const std::string& inside) {
  return std::string("<joint name='") + name + "' type='revolute'><parent link='" + parent + "'/><child link='" +
         child + "'/>" + inside + "</joint>\n";
}

// Factors multiplied in float64, as in MoveIt; the order of the joints in the file does not matter.
TEST(Robot, AJointMayMimicOneThatMimics) {
  const std::string any = "<limit lower='-1' upper='1'/>";
  const RobotModel robot =
      parse_urdf("<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>" +
                     turning("far", "a", "b", any + "<mimic joint='near' multiplier='-2' offset='0.25'/>") +
                     turning("near", "b", "c", any + "<mimic joint='lead' multiplier='0.5' offset='1'/>") +
                     turning("lead", "c", "d", any) + "</robot>",
                 "r.urdf");
  const Mimic& far = *robot.joints[robot.find_joint("far")].mimic;
  EXPECT_EQ(far.joint, robot.find_joint("lead"));
  EXPECT_EQ(far.multiplier, -1);
  EXPECT_EQ(far.offset, -2 + 0.25);
  EXPECT_EQ(robot.joints[robot.find_joint("near")].mimic->multiplier, 0.5);
  EXPECT_EQ(robot.columns.size(), 1u);
}

TEST(Robot, ALimitThatIsNotThereIs0) {
  const RobotModel robot =
      parse_urdf("<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>\n" +
                     turning("upper", "a", "b", "<limit upper='1' effort='1'/>") +
                     turning("lower", "b", "c", "<limit lower='-1'/>") +
                     turning("none", "c", "d", "<limit effort='1' velocity='1'/>") + "</robot>",
                 "r.urdf");
  const auto limits = [&](const char* name) {
    const RobotColumn& column = robot.columns[robot.find_column(name)];
    return std::pair(column.lower, column.upper);
  };
  EXPECT_EQ(limits("upper"), std::pair(0.0, 1.0));
  EXPECT_EQ(limits("lower"), std::pair(-1.0, 0.0));
  EXPECT_EQ(limits("none"), std::pair(0.0, 0.0));
  ASSERT_EQ(robot.warnings.size(), 1u);
  EXPECT_EQ(robot.warnings[0],
            "r.urdf:4: joint \"none\": limit: neither lower nor upper: both are 0, and every other position is beyond "
            "them; a joint that turns without end has the type continuous");
}

TEST(Robot, AVisualThatCannotBeUsedHarmsNoCollision) {
  const RobotModel robot = parse_urdf(
      "<robot name='r'><link name='a'><collision><geometry><sphere radius='1'/></geometry></collision>\n"
      "<visual><geometry><box size='0 0 0'/></geometry></visual><visual/></link></robot>",
      "r.urdf");
  const RobotLink& link = robot.links[0];
  EXPECT_EQ(link.collision.size(), 1u);
  EXPECT_EQ(link.collision[0].problem, "");
  ASSERT_EQ(link.visual.size(), 2u);
  EXPECT_EQ(link.visual[0].problem,
            "r.urdf:2: link \"a\": visual: geometry: box: size: expected numbers > 0, got \"0 0 0\"");
  EXPECT_EQ(link.visual[1].problem, "r.urdf:2: link \"a\": visual: expected an element <geometry>");
}

// Elements that other programs read, or none, may contain text that resembles a macro.
TEST(Robot, WhatOnlyLooksLikeAMacroIsTaken) {
  const RobotModel robot = parse_urdf(
      "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'><link name='a$(b)'/><gazebo a='${x}'/></robot>",
      "r.urdf");
  EXPECT_EQ(robot.links[0].name, "a$(b)");
}

TEST(Robot, AnSrdfAddsGroupsStatesAndPairs) {
  RobotModel robot = every_joint();
  read_srdf(kFolder + "every_joint.srdf", &robot);
  const auto names = [&](const char* group) {
    std::vector<std::string> out;
    for (const std::uint32_t column : robot.find_group(group)->columns) out.push_back(robot.columns[column].name);
    return out;
  };
  EXPECT_EQ(names("arm"), (std::vector<std::string>{"turn", "lift", "roll"}));
  EXPECT_EQ(names("gripper"), (std::vector<std::string>{"grip_left"}));
  EXPECT_EQ(names("everything"),
            (std::vector<std::string>{"drive/x", "drive/y", "drive/theta", "turn", "lift", "roll", "grip_left"}));
  ASSERT_EQ(robot.states.size(), 2u);
  using Positions = std::vector<std::pair<std::uint32_t, double>>;
  EXPECT_EQ(robot.states[0].positions, (Positions{{robot.find_column("turn"), -1.5}, {0, 1}, {1, 2}, {2, 0.5}}));
  EXPECT_EQ(robot.states[1].group, "arm");
  ASSERT_EQ(robot.disabled.size(), 2u);
  EXPECT_EQ(robot.disabled[0].a, std::min(robot.find_link("hand"), robot.find_link("left_finger")));
  EXPECT_EQ(robot.disabled[1].reason, "Adjacent") << "the first of two";
}

using Names = std::vector<std::string>;

// Result of an SRDF's pairs for four links a, b, c, d: "ab" for a disabled pair.
Names left_out(const std::string& pairs, RobotModel* read = nullptr) {
  const std::string any = "<limit lower='-1' upper='1'/>";
  RobotModel robot = parse_urdf("<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>" +
                                    turning("i", "a", "b", any) + turning("j", "b", "c", any) +
                                    turning("k", "c", "d", any) + "</robot>",
                                "r.urdf");
  parse_srdf("<robot name='r'>\n" + pairs + "</robot>", "r.srdf", &robot);
  Names names;
  for (const DisabledPair& pair : robot.disabled) names.push_back(robot.links[pair.a].name + robot.links[pair.b].name);
  if (read) *read = std::move(robot);
  return names;
}

// As in MoveIt: a link's default first, then enabled pairs, and last disabled ones, in any order of the file.
TEST(Robot, AnSrdfMayDisableAllPairsOfALink) {
  const std::string defaults = "<disable_default_collisions link='b'/>\n",
                    enable = "<enable_collisions link1='d' link2='b'/>\n",
                    disable = "<disable_collisions link1='a' link2='b' reason='Adjacent'/>\n";
  EXPECT_EQ(left_out(defaults), (Names{"ab", "bc", "bd"}));
  EXPECT_EQ(left_out(defaults + enable), (Names{"ab", "bc"}));
  EXPECT_EQ(left_out(enable + defaults), (Names{"ab", "bc"}));
  EXPECT_EQ(left_out(enable), Names{});
  EXPECT_EQ(left_out(defaults + "<disable_default_collisions link='d'/>" + enable), (Names{"ab", "ad", "bc", "cd"}))
      << "one that is enabled stays, though both links are disabled";
  RobotModel robot;
  EXPECT_EQ(left_out(enable + disable + defaults, &robot), (Names{"ab", "bc"}));
  EXPECT_EQ(robot.disabled[0].reason, "Adjacent") << "by name, and not by default";
  EXPECT_EQ(robot.enabled, (std::vector<std::pair<std::uint32_t, std::uint32_t>>{{1, 3}}));
  EXPECT_TRUE(robot.warnings.empty());
}

TEST(Robot, PairsThatContradictOrNameNoBodyAreWarnedOf) {
  RobotModel robot;
  EXPECT_EQ(left_out("<enable_collisions link1='a' link2='b'/>\n<disable_collisions link1='b' link2='a'/>\n"
                     "<disable_default_collisions link='x'/>\n<enable_collisions link1='a' link2='y'/>\n",
                     &robot),
            Names{"ab"});
  EXPECT_TRUE(robot.enabled.empty());
  EXPECT_EQ(
      robot.warnings,
      (Names{"r.srdf:2: enable_collisions: the pair is disabled by name as well, which counts; the pair is left out",
             "r.srdf:5: enable_collisions: there is no link \"y\" in the URDF; the pair is left out",
             "r.srdf:4: disable_default_collisions: there is no link \"x\" in the URDF; it is left out"}));
}

TEST(Robot, UnknownElementsOfAnSrdfAreWarnedOfOnce) {
  RobotModel robot;
  left_out(
      "<disable_colisions link1='a' link2='b'/>\n<disable_colisions link1='a' link2='b'/>\n"
      "<group name='g'><link name='a'/>\n<links name='b'/></group>\n<group_state name='s' group='g'>\n<Joint/>"
      "</group_state><end_effector name='e' group='g' parent_link='a'/><virtual_joint name='v'/><passive_joint "
      "name='j'/><link_sphere_approximation link='a'><sphere/></link_sphere_approximation><joint_property/>",
      &robot);
  EXPECT_EQ(robot.warnings, (Names{"r.srdf:2: disable_colisions: an unknown element; it is not read",
                                   "r.srdf:5: group \"g\": links \"b\": an unknown element; it is not read",
                                   "r.srdf:7: group_state \"s\": Joint: an unknown element; it is not read"}));
}

// Half a group, or a pair of one link, would be a surprise: they are dropped whole, with a warning.
TEST(Robot, WhatAnSrdfNamesInVainIsLeftOutWithAWarning) {
  RobotModel robot = every_joint();
  read_srdf(kFolder + "every_joint.srdf", &robot);
  EXPECT_EQ(robot.find_group("gone"), nullptr);
  EXPECT_EQ(robot.find_group("with_gone"), nullptr);
  std::vector<std::string> warnings;
  for (const std::string& w : robot.warnings) warnings.push_back(w.substr(w.find("every_joint.srdf")));
  const std::string file = "every_joint.srdf:";
  EXPECT_EQ(
      warnings,
      (std::vector<std::string>{
          file + "7: group \"gone\": joint \"never_was\": there is no joint \"never_was\" in the URDF; the group "
                 "\"gone\" is left out",
          file + "8: group \"with_gone\": group \"gone\": this group is left out; the group \"with_gone\" is left out",
          file + "10: group_state \"home\": joint \"world_joint\": a virtual joint; the scene sets the pose of a base; "
                 "this position is left out",
          file + "13: group_state \"home\": joint \"grip_right\": this joint mimics another; this position is left out",
          file + "19: disable_collisions: there is no link \"tail\" in the URDF; the pair is left out"}));
}

}  // namespace
}  // namespace clearance
