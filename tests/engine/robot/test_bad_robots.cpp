// Invalid robots, and the text of each error: cause, file, line and element.
#include <gtest/gtest.h>

#include "engine/robot/robot.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

struct BadCase {
  const char* name;
  std::string text;   // of the file
  std::string error;  // without the file's name
};
std::ostream& operator<<(std::ostream& out, const BadCase& bad) {
  return out << bad.name;
}

// A robot of two links, on the file's second line, and a joint with this type and content on its third.
std::string joint(const std::string& type, const std::string& inside) {
  return "<robot name='r'>\n<link name='a'/><link name='b'/>\n<joint name='j' type='" + type +
         "'><parent link='a'/><child link='b'/>" + inside + "</joint></robot>";
}
std::string shape(const std::string& inside) {
  return "<robot name='r'>\n<link name='a'>\n<collision>" + inside + "</collision></link></robot>";
}
std::string links(const std::string& joints) {
  return "<robot name='r'>\n<link name='a'/><link name='b'/><link name='c'/>\n" + joints + "</robot>";
}
std::string fixed(const char* name, const char* parent, const char* child) {
  return std::string("<joint name='") + name + "' type='fixed'><parent link='" + parent + "'/><child link='" + child +
         "'/></joint>\n";
}
std::string mimics(const std::string& one, const std::string& other) {
  const auto turning = [](const char* name, const char* parent, const char* child, const std::string& inside) {
    return std::string("<joint name='") + name + "' type='continuous'><parent link='" + parent + "'/><child link='" +
           child + "'/>" + inside + "</joint>\n";
  };
  return links(turning("j", "a", "b", one) + turning("k", "b", "c", other));
}

const std::string kLimit = "<limit lower='0' upper='1'/>";
const std::string kDeep = [] {
  std::string text;
  for (int i = 0; i < 70; ++i) text += "<x>";
  for (int i = 0; i < 70; ++i) text += "</x>";
  return text;
}();

const std::vector<BadCase> kBadUrdfs = {
    // the file
    {"empty", "", "1: invalid XML: No document element found"},
    {"not_xml", "robot", "1: invalid XML: No document element found"},
    {"cut_short", "<robot name='r'>\n<link", "2: invalid XML: Error parsing start element tag"},
    {"wrong_end", "<robot name='r'>\n</link>", "2: invalid XML: Start-end tags mismatch"},
    {"zero_byte", std::string("<robot\n\0>", 9), "2: a zero byte; expected text"},
    {"another_root", "<sdf/>", "1: expected the element <robot>, got <sdf>"},
    {"two_roots", "<robot name='r'><link name='a'/></robot>\n<robot/>", "2: a second outermost element"},
    {"deep", "<robot name='r'>" + kDeep + "</robot>", "1: nested deeper than 64 elements"},
    {"attribute_twice", "<robot name='r'>\n<link name='a' name='b'/></robot>", "2: link \"a\": name: is set twice"},
    {"macros", "<robot name='r'>\n<xacro:macro name='m'/></robot>",
     "2: xacro:macro \"m\": a macro of xacro; expand the file first: xacro FILE > robot.urdf"},
    {"macros_of_another_prefix",
     "<robot name='r' xmlns:x='http://www.ros.org/wiki/xacro'>\n<x:include filename='a'/></robot>",
     "2: x:include: a macro of xacro; expand the file first: xacro FILE > robot.urdf"},
    {"macro_in_a_link", "<robot name='r'>\n<link name='a'>\n<xacro:if value='1'/></link></robot>",
     "3: link \"a\": xacro:if: a macro of xacro; expand the file first: xacro FILE > robot.urdf"},
    {"name_of_a_macro", "<robot name='r'>\n<link name='${prefix}a'/></robot>",
     "2: link \"${prefix}a\": name: xacro replaces a part of \"${prefix}a\"; expand the file first: xacro FILE > "
     "robot.urdf"},
    {"mesh_of_a_macro", shape("<geometry><mesh filename='$(find p)/a.stl'/></geometry>"),
     "3: link \"a\": collision: geometry: mesh: filename: xacro replaces a part of \"$(find p)/a.stl\"; expand the "
     "file "
     "first: xacro FILE > robot.urdf"},
    {"no_name", "<robot><link name='a'/></robot>", "1: expected the attribute name"},
    {"no_links", "<robot name='r'/>", "1: expected at least one <link>"},
    // links and shapes
    {"link_without_name", "<robot name='r'>\n<link/></robot>", "2: link: expected the attribute name"},
    {"link_with_empty_name", "<robot name='r'><link name=''/></robot>",
     "1: link \"\": name: expected a text, got none"},
    {"link_twice", "<robot name='r'>\n<link name='a'/>\n<link name='a'/></robot>",
     "3: link \"a\": there is one of this name already"},
    {"no_geometry", shape(""), "3: link \"a\": collision: expected an element <geometry>"},
    {"empty_geometry", shape("<geometry/>"), "3: link \"a\": collision: geometry: expected one shape, got 0"},
    {"two_shapes", shape("<geometry><sphere radius='1'/><sphere radius='1'/></geometry>"),
     "3: link \"a\": collision: geometry: expected one shape, got 2"},
    {"unknown_shape", shape("<geometry><cone/></geometry>"),
     "3: link \"a\": collision: geometry: cone: expected box, sphere, cylinder, capsule or mesh"},
    {"negative_box", shape("<geometry><box size='1 -1 1'/></geometry>"),
     "3: link \"a\": collision: geometry: box: size: expected numbers > 0, got \"1 -1 1\""},
    {"flat_box", shape("<geometry><box size='1 0 1'/></geometry>"),
     "3: link \"a\": collision: geometry: box: size: expected numbers > 0, got \"1 0 1\""},
    {"short_box", shape("<geometry><box size='1 1'/></geometry>"),
     "3: link \"a\": collision: geometry: box: size: expected 3 numbers, got \"1 1\""},
    {"long_box", shape("<geometry><box size='1 1 1 1'/></geometry>"),
     "3: link \"a\": collision: geometry: box: size: expected 3 numbers, got \"1 1 1 1\""},
    {"box_without_size", shape("<geometry><box/></geometry>"),
     "3: link \"a\": collision: geometry: box: expected the attribute size"},
    {"negative_radius", shape("<geometry><sphere radius='-1'/></geometry>"),
     "3: link \"a\": collision: geometry: sphere: radius: expected a number > 0, got \"-1\""},
    {"negative_length", shape("<geometry><cylinder radius='1' length='-1'/></geometry>"),
     "3: link \"a\": collision: geometry: cylinder: length: expected a number > 0, got \"-1\""},
    {"negative_capsule", shape("<geometry><capsule radius='-1' length='1'/></geometry>"),
     "3: link \"a\": collision: geometry: capsule: radius: expected a number > 0, got \"-1\""},
    {"infinite_box", shape("<geometry><box size='1 inf 1'/></geometry>"),
     "3: link \"a\": collision: geometry: box: size: expected a finite number, got \"inf\""},
    {"no_length", shape("<geometry><cylinder radius='1'/></geometry>"),
     "3: link \"a\": collision: geometry: cylinder: expected the attribute length"},
    {"no_number", shape("<geometry><sphere radius='1,5'/></geometry>"),
     "3: link \"a\": collision: geometry: sphere: radius: expected a number, got \"1,5\""},
    {"hexadecimal", shape("<geometry><sphere radius='0x1'/></geometry>"),
     "3: link \"a\": collision: geometry: sphere: radius: expected a number, got \"0x1\""},
    {"nan_origin", shape("<origin xyz='0 nan 0'/><geometry><sphere radius='1'/></geometry>"),
     "3: link \"a\": collision: origin: xyz: expected a finite number, got \"nan\""},
    {"infinite_angle", shape("<origin rpy='0 0 1e999'/><geometry><sphere radius='1'/></geometry>"),
     "3: link \"a\": collision: origin: rpy: expected a finite number, got \"1e999\""},
    {"huge_angle", shape("<origin rpy='0 0 1e7'/><geometry><sphere radius='1'/></geometry>"),
     "3: link \"a\": collision: origin: rpy: expected angles up to 1e6 radians"},
    {"far_away", shape("<origin xyz='0 0 1e7'/><geometry><sphere radius='1'/></geometry>"),
     "3: link \"a\": collision: origin: xyz: expected coordinates up to 1e6 m"},
    {"two_origins", shape("<origin/><origin/><geometry><sphere radius='1'/></geometry>"),
     "3: link \"a\": collision: origin: there is one already; expected one at most"},
    {"mesh_without_file", shape("<geometry><mesh/></geometry>"),
     "3: link \"a\": collision: geometry: mesh: expected the attribute filename"},
    {"zero_scale", shape("<geometry><mesh filename='x.stl' scale='1 1 0'/></geometry>"),
     "3: link \"a\": collision: geometry: mesh: scale: expected factors other than 0"},
    {"nan_scale", shape("<geometry><mesh filename='x.stl' scale='1 nan 1'/></geometry>"),
     "3: link \"a\": collision: geometry: mesh: scale: expected a finite number, got \"nan\""},
    {"short_scale", shape("<geometry><mesh filename='x.stl' scale='2'/></geometry>"),
     "3: link \"a\": collision: geometry: mesh: scale: expected 3 numbers, got \"2\""},
    {"mesh_with_empty_name", shape("<geometry><mesh filename=''/></geometry>"),
     "3: link \"a\": collision: geometry: mesh: filename: expected a text, got none"},
    // joints
    {"joint_without_name", links("<joint type='fixed'><parent link='a'/><child link='b'/></joint>"),
     "3: joint: expected the attribute name"},
    {"joint_without_type", links("<joint name='j'><parent link='a'/><child link='b'/></joint>"),
     "3: joint \"j\": expected the attribute type"},
    {"type_in_capitals", joint("Revolute", kLimit),
     "3: joint \"j\": type: expected fixed, revolute, continuous, prismatic, planar or floating, got \"Revolute\""},
    {"no_child", links("<joint name='j' type='fixed'><parent link='a'/></joint>"),
     "3: joint \"j\": expected an element <child>"},
    {"two_children", joint("fixed", "<child link='b'/>"),
     "3: joint \"j\": child: there is one already; expected one at most"},
    {"parent_without_link", links("<joint name='j' type='fixed'><parent/><child link='b'/></joint>"),
     "3: joint \"j\": parent: expected the attribute link"},
    {"missing_parent", links(fixed("j", "d", "b")), "3: joint \"j\": parent: there is no link \"d\""},
    {"nan_joint_origin", joint("fixed", "<origin xyz='nan 0 0'/>"),
     "3: joint \"j\": origin: xyz: expected a finite number, got \"nan\""},
    {"long_joint_origin", joint("fixed", "<origin xyz='0 0 0 1'/>"),
     "3: joint \"j\": origin: xyz: expected 3 numbers, got \"0 0 0 1\""},
    {"unknown_type", joint("screw", ""),
     "3: joint \"j\": type: expected fixed, revolute, continuous, prismatic, planar or floating, got \"screw\""},
    {"joint_twice", links(fixed("j", "a", "b") + fixed("j", "b", "c")),
     "4: joint \"j\": there is one of this name already"},
    {"no_parent", links("<joint name='j' type='fixed'><child link='b'/></joint>"),
     "3: joint \"j\": expected an element <parent>"},
    {"missing_link", links(fixed("j", "a", "d")), "3: joint \"j\": child: there is no link \"d\""},
    {"on_itself", links(fixed("j", "a", "a")), "3: joint \"j\": its parent and child are the same link"},
    {"two_parents", links(fixed("j", "a", "c") + fixed("k", "b", "c")),
     "4: joint \"k\": the link \"c\" already has the parent joint \"j\"; links must form a tree"},
    {"cycle", links(fixed("j", "a", "b") + fixed("k", "b", "c") + fixed("l", "c", "a")),
     "1: every link has a parent: the joints form a cycle"},
    {"cycle_beside_a_base", links(fixed("j", "b", "c") + fixed("k", "c", "b")),
     "3: joint \"j\": it is its own ancestor: the joints form a cycle"},
    {"two_bases", links(fixed("j", "a", "b")),
     "1: two links have no parent joint, \"a\" and \"c\"; a robot has one base"},
    {"zero_axis", joint("continuous", "<axis xyz='0 0 0'/>"),
     "3: joint \"j\": axis: expected an axis other than 0 0 0 of a joint that moves"},
    {"zero_axis_of_what_slides", joint("prismatic", "<axis xyz='0 -0 0'/>" + kLimit),
     "3: joint \"j\": axis: expected an axis other than 0 0 0 of a joint that moves"},
    {"zero_axis_with_limits", joint("revolute", "<axis xyz='0 0 0'/>" + kLimit),
     "3: joint \"j\": axis: expected an axis other than 0 0 0 of a joint that moves"},
    {"zero_axis_of_a_plane", joint("planar", "<axis xyz='0 0 0'/>"),
     "3: joint \"j\": axis: expected an axis other than 0 0 0 of a joint that moves"},
    {"short_axis", joint("continuous", "<axis xyz='0 1'/>"),
     "3: joint \"j\": axis: xyz: expected 3 numbers, got \"0 1\""},
    {"huge_axis", joint("continuous", "<axis xyz='1e200 0 0'/>"),
     "3: joint \"j\": axis: xyz: expected coordinates up to 1e6"},
    {"two_axes", joint("continuous", "<axis xyz='0 1 0'/><axis xyz='0 0 1'/>"),
     "3: joint \"j\": axis: there is one already; expected one at most"},
    {"nan_axis", joint("prismatic", "<axis xyz='0 nan 1'/>" + kLimit),
     "3: joint \"j\": axis: xyz: expected a finite number, got \"nan\""},
    {"axis_without_xyz", joint("continuous", "<axis/>"), "3: joint \"j\": axis: expected the attribute xyz"},
    {"no_limit", joint("revolute", ""), "3: joint \"j\": expected an element <limit>"},
    {"upper_limit_below_0", joint("revolute", "<limit upper='-1'/>"),
     "3: joint \"j\": limit: lower \"0\" is above upper \"-1\""},
    {"nan_limit", joint("prismatic", "<limit lower='nan' upper='1'/>"),
     "3: joint \"j\": limit: lower: expected a finite number, got \"nan\""},
    {"nan_upper_limit", joint("revolute", "<limit lower='0' upper='nan'/>"),
     "3: joint \"j\": limit: upper: expected a finite number, got \"nan\""},
    {"infinite_limit", joint("revolute", "<limit lower='-inf' upper='0'/>"),
     "3: joint \"j\": limit: lower: expected a finite number, got \"-inf\""},
    {"limit_in_words", joint("revolute", "<limit lower='none' upper='0'/>"),
     "3: joint \"j\": limit: lower: expected a number, got \"none\""},
    {"two_limits", joint("revolute", kLimit + kLimit),
     "3: joint \"j\": limit: there is one already; expected one at most"},
    {"what_slides_without_limit", joint("prismatic", ""), "3: joint \"j\": expected an element <limit>"},
    {"limits_swapped", joint("revolute", "<limit lower='2' upper='1'/>"),
     "3: joint \"j\": limit: lower \"2\" is above upper \"1\""},
    {"tilted_plane", joint("planar", "<axis xyz='0 1 0'/>"),
     "3: joint \"j\": axis: a planar joint must have the axis 0 0 1: URDF does not define x and y for another "
     "axis"},
    {"plane_without_axis", joint("planar", ""),
     "3: joint \"j\": a planar joint must have the axis 0 0 1: URDF does not define x and y for another axis"},
    {"mimic_of_nobody", mimics("<mimic joint='x'/>", ""), "3: joint \"j\": mimic: there is no joint \"x\""},
    {"mimic_of_itself", mimics("<mimic joint='j'/>", ""), "3: joint \"j\": mimic: it mimics itself"},
    {"mimic_of_mimic", mimics("<mimic joint='k'/>", "<mimic joint='j'/>"),
     "3: joint \"j\": mimic: it mimics itself through others"},
    {"mimic_of_mimic_by_too_much",
     links("<joint name='i' type='continuous'><parent link='a'/><child link='b'/></joint>\n"
           "<joint name='j' type='continuous'><parent link='b'/><child link='c'/><mimic joint='i' multiplier='1e4'/>"
           "</joint>\n<link name='d'/><joint name='k' type='continuous'><parent link='c'/><child link='d'/><mimic "
           "joint='j' multiplier='1e4'/></joint>"),
     "5: joint \"k\": mimic: expected a multiplier and an offset up to 1e6"},
    {"mimic_of_a_fixed_joint",
     links(fixed("f", "a", "b") + "<joint name='j' type='continuous'><parent link='b'/><child link='c'/><mimic "
                                  "joint='f'/></joint>"),
     "4: joint \"j\": mimic: the joint \"f\" has not one position; expected a revolute, continuous or prismatic one"},
    {"floating_mimic", joint("floating", "<mimic joint='j'/>"),
     "3: joint \"j\": mimic: only a revolute, continuous or prismatic joint can mimic another"},
    {"mimic_without_joint", mimics("<mimic/>", ""), "3: joint \"j\": mimic: expected the attribute joint"},
    {"two_mimics", mimics("", "<mimic joint='j'/><mimic joint='j'/>"),
     "4: joint \"k\": mimic: there is one already; expected one at most"},
    {"nan_multiplier", mimics("", "<mimic joint='j' multiplier='nan'/>"),
     "4: joint \"k\": mimic: multiplier: expected a finite number, got \"nan\""},
    {"infinite_multiplier", mimics("", "<mimic joint='j' multiplier='-inf'/>"),
     "4: joint \"k\": mimic: multiplier: expected a finite number, got \"-inf\""},
    {"huge_offset", mimics("", "<mimic joint='j' offset='1e7'/>"),
     "4: joint \"k\": mimic: expected a multiplier and an offset up to 1e6"},
    {"column_twice",
     links("<joint name='j' type='planar'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>\n"
           "<joint name='j/x' type='continuous'><parent link='b'/><child link='c'/></joint>"),
     "4: joint \"j/x\": two joints have a position \"j/x\""},
};

const std::vector<BadCase> kBadSrdfs = {
    {"another_root", "<sdf/>", "1: expected the element <robot>, got <sdf>"},
    {"another_robot", "<robot name='s'>\n<disable_collisions link1='a' link2='x'/></robot>",
     "2: disable_collisions: there is no link \"x\" in the URDF; this SRDF is for the robot \"s\", the URDF for \"r\""},
    {"another_robots_group", "<robot name='s'>\n<group name='g'><joint name='x'/></group></robot>",
     "2: group \"g\": joint \"x\": there is no joint \"x\" in the URDF; this SRDF is for the robot \"s\", the URDF for "
     "\"r\""},
    {"group_twice", "<robot name='r'><group name='g'/>\n<group name='g'/></robot>",
     "2: group \"g\": there is a group of this name already"},
    {"group_in_itself",
     "<robot name='r'><group name='g'><group name='h'/></group>\n<group name='h'><group "
     "name='g'/></group></robot>",
     "2: group \"h\": group \"g\": the group holds itself"},
    {"group_without_name", "<robot name='r'><group/></robot>", "1: group: expected the attribute name"},
    {"position_twice",
     "<robot name='r'><group name='g'/><group_state name='s' group='g'><joint name='j' value='0'/>\n"
     "<joint name='j' value='1'/></group_state></robot>",
     "2: group_state \"s\": joint \"j\": its position is set already"},
    {"nan_position", "<robot name='r'><group_state name='s'><joint name='j' value='nan'/></group_state></robot>",
     "1: group_state \"s\": joint \"j\": value: expected a finite number, got \"nan\""},
    {"infinite_position", "<robot name='r'><group_state name='s'><joint name='j' value='inf'/></group_state></robot>",
     "1: group_state \"s\": joint \"j\": value: expected a finite number, got \"inf\""},
    {"two_positions_in_one",
     "<robot name='r'><group_state name='s'><joint name='j' value='0 1'/></group_state></robot>",
     "1: group_state \"s\": joint \"j\": value: expected a number, got \"0 1\""},
    {"no_position", "<robot name='r'><group_state name='s'><joint name='j'/></group_state></robot>",
     "1: group_state \"s\": joint \"j\": expected the attribute value"},
    {"chain_without_tip", "<robot name='r'><group name='g'><chain base_link='a'/></group></robot>",
     "1: group \"g\": chain: expected the attribute tip_link"},
    {"half_a_pair", "<robot name='r'><disable_collisions link1='a'/></robot>",
     "1: disable_collisions: expected the attribute link2"},
    {"state_twice", "<robot name='r'><group_state name='s'/>\n<group_state name='s'/></robot>",
     "2: group_state \"s\": there is a state of this name and group already"},
    {"link_with_itself", "<robot name='r'><disable_collisions link1='a' link2='a'/></robot>",
     "1: disable_collisions: a link with itself"},
    {"enabled_with_itself", "<robot name='r'>\n<enable_collisions link1='a' link2='a'/></robot>",
     "2: enable_collisions: a link with itself"},
    {"half_an_enabled_pair", "<robot name='r'><enable_collisions link1='a'/></robot>",
     "1: enable_collisions: expected the attribute link2"},
    {"default_of_no_link", "<robot name='r'><disable_default_collisions/></robot>",
     "1: disable_default_collisions: expected the attribute link"},
    {"another_robots_default", "<robot name='s'>\n<disable_default_collisions link='x'/></robot>",
     "2: disable_default_collisions: there is no link \"x\" in the URDF; this SRDF is for the robot \"s\", the URDF "
     "for "
     "\"r\""},
    {"macros", "<robot name='r'>\n<xacro:panda_pairs/></robot>",
     "2: xacro:panda_pairs: a macro of xacro; expand the file first: xacro FILE > robot.srdf"},
    {"macros_of_another_prefix",
     "<robot name='r' xmlns:m='http://ros.org/xacro'><group name='g'>\n<m:links/></group></robot>",
     "2: group \"g\": m:links: a macro of xacro; expand the file first: xacro FILE > robot.srdf"},
    {"name_of_a_macro", "<robot name='r'><disable_collisions link1='a'\nlink2='${arm_id}_b'/></robot>",
     "1: disable_collisions: link2: xacro replaces a part of \"${arm_id}_b\"; expand the file first: xacro FILE > "
     "robot.srdf"},
    {"substitution", "<robot name='$(arg name)'/>",
     "1: name: xacro replaces a part of \"$(arg name)\"; expand the file first: xacro FILE > robot.srdf"},
};

template <class F>
std::string error_of(F&& f) {
  try {
    f();
    return "";
  } catch (const RobotError& error) {
    return error.what();
  }
}

class BadUrdf : public testing::TestWithParam<BadCase> {};
TEST_P(BadUrdf, IsRejected) {
  EXPECT_EQ(error_of([] { parse_urdf(GetParam().text, "bad.urdf"); }), "bad.urdf:" + GetParam().error);
}
INSTANTIATE_TEST_SUITE_P(, BadUrdf, testing::ValuesIn(kBadUrdfs), [](const auto& p) { return p.param.name; });

class BadSrdf : public testing::TestWithParam<BadCase> {};
TEST_P(BadSrdf, IsRejectedAndLeavesNothing) {
  RobotModel robot = parse_urdf(joint("continuous", ""), "good.urdf");
  EXPECT_EQ(error_of([&] { parse_srdf(GetParam().text, "bad.srdf", &robot); }), "bad.srdf:" + GetParam().error);
  EXPECT_TRUE(robot.groups.empty() && robot.states.empty() && robot.disabled.empty() && robot.warnings.empty());
}
INSTANTIATE_TEST_SUITE_P(, BadSrdf, testing::ValuesIn(kBadSrdfs), [](const auto& p) { return p.param.name; });

TEST(BadRobot, FilesThatCannotBeRead) {
  const TemporaryFolder folder;
  const std::string none = folder / "none.urdf", path = folder.path();
  EXPECT_EQ(error_of([&] { read_urdf(none); }), none + ": No such file or directory");
  EXPECT_EQ(error_of([&] { read_urdf(path); }), path + ": not a plain file");
  const std::string large = folder.write("large.urdf", std::string((8 << 20) + 1, ' '));
  EXPECT_EQ(error_of([&] { read_urdf(large); }), large + ": larger than 8 MiB");
}

TEST(BadRobot, TooManyLinks) {
  std::string text = "<robot name='r'>\n";
  for (int i = 0; i <= 10'000; ++i) text += "<link name='" + std::to_string(i) + "'/>\n";
  EXPECT_EQ(error_of([&] { parse_urdf(text + "</robot>", "bad.urdf"); }),
            "bad.urdf:10002: link \"10000\": more than 10000 links");
}

// 5,000 links without a default would have 25 million pairs.
TEST(BadRobot, MorePairsByDefaultThanAnyRobotHas) {
  std::string text = "<robot name='r'><link name='0'/>\n", srdf = "<robot name='r'>\n";
  for (int i = 1; i < 5000; ++i)
    text += "<link name='" + std::to_string(i) + "'/>" +
            fixed(("j" + std::to_string(i)).c_str(), "0", std::to_string(i).c_str());
  RobotModel robot = parse_urdf(text + "</robot>", "good.urdf");
  for (int i = 0; i < 201; ++i) srdf += "<disable_default_collisions link='" + std::to_string(i) + "'/>\n";
  EXPECT_EQ(error_of([&] { parse_srdf(srdf + "</robot>", "bad.srdf", &robot); }),
            "bad.srdf:202: disable_default_collisions: links with more than 1000000 pairs are disabled by default");
}

// A small file may name a long chain many times.
TEST(BadRobot, GroupsOfMoreMembersThanAnyRobotHas) {
  std::string text = "<robot name='r'><link name='0'/>\n";
  for (int i = 1; i < 2000; ++i)
    text += "<link name='" + std::to_string(i) + "'/>" +
            fixed(("j" + std::to_string(i)).c_str(), std::to_string(i - 1).c_str(), std::to_string(i).c_str());
  RobotModel robot = parse_urdf(text + "</robot>", "good.urdf");
  std::string groups = "<robot name='r'><group name='g'>";
  for (int i = 0; i < 600; ++i) groups += "<chain base_link='0' tip_link='1999'/>\n";
  EXPECT_EQ(error_of([&] { parse_srdf(groups + "</group></robot>", "bad.srdf", &robot); }),
            "bad.srdf:501: group \"g\": chain: more than 1000000 members of groups");
}

TEST(BadRobot, MeshesThatAreNotThere) {
  const TemporaryFolder folder;
  const std::string path = folder.path();
  const RobotModel robot = parse_urdf(shape("<geometry><mesh filename='package://arm/m.stl'/></geometry>"), "r.urdf");
  RobotShape mesh = robot.links[0].collision[0];
  const std::string place = "r.urdf:3: link \"a\": collision: mesh ";
  EXPECT_EQ(error_of([&] { mesh_path(mesh, "", {{"leg", "."}}); }),
            place +
                "\"package://arm/m.stl\": the package \"arm\" has no folder here, and neither AMENT_PREFIX_PATH nor "
                "ROS_PACKAGE_PATH leads to one; name it under packages");
  EXPECT_EQ(error_of([&] { mesh_path(mesh, "", {{"arm", path}}); }),
            place + "\"package://arm/m.stl\": there is no file " + path + "/m.stl");
  mesh.mesh = "package:///m.stl";
  EXPECT_EQ(error_of([&] { mesh_path(mesh, "", {}); }),
            place + "\"package:///m.stl\": it names no package; expected package://NAME/...");
  mesh.mesh = "http://arm/m.stl";
  EXPECT_EQ(error_of([&] { mesh_path(mesh, "", {}); }),
            place + "\"http://arm/m.stl\": expected a path, package:// or file://");
  mesh.mesh = "m.stl";
  EXPECT_EQ(error_of([&] { mesh_path(mesh, path, {}); }), place + "\"m.stl\": there is no file " + path + "/m.stl");
}

}  // namespace
}  // namespace clearance
