// Arbitrary URDF and, after a zero byte, SRDF: a robot, or an error that names the file.
#include <vector>

#include "engine/robot/kinematics.h"
#include "tests/fuzz/fuzz_target.h"

namespace clearance::fuzz {
namespace {

void check_robot(const RobotModel& robot) {
  require(robot.base < robot.links.size(), "a robot has a base");
  require(robot.joints.size() + 1 == robot.links.size(), "every other link hangs on a joint");
  for (std::uint32_t j = 0; j < robot.joints.size(); ++j) {
    const RobotJoint& joint = robot.joints[j];
    require(robot.links[joint.child].joint == j, "joint and link agree");
    const std::uint32_t carrier = robot.links[joint.parent].joint;
    require(carrier == kNone || carrier < j, "joints stand behind what carries them");
    require(joint.column == kNone || joint.column < robot.columns.size(), "columns are there");
    require(!joint.mimic || (joint.mimic->joint < robot.joints.size() && joint.column == kNone),
            "mimics take no position");
  }
  for (const RobotGroup& group : robot.groups)
    for (const std::uint32_t column : group.columns) require(column < robot.columns.size(), "groups name columns");
  for (const DisabledPair& pair : robot.disabled)
    require(pair.a < pair.b && pair.b < robot.links.size(), "pairs are of two links");
}

// At position 0 every link has a pose, or none because of a mimic joint's offset.
void check_kinematics(const RobotModel& robot) {
  const Kinematics kinematics(robot);
  const std::vector<double> positions(kinematics.columns());
  const std::vector<Pose> roots(kinematics.roots().size());
  std::vector<Pose> poses(kinematics.links());
  Status status[1];
  kinematics.place(positions, roots, poses, status);
  for (std::uint32_t link = 0; link < poses.size(); ++link) {
    require(status[0] == Status::kBadPose || check(poses[link]) == PoseQuality::kGood,
            "links of good positions have good poses");
    if (link < 100) require(kinematics.error(link, 1).at(0, 0) >= 0, "errors are lengths");
  }
}

}  // namespace
}  // namespace clearance::fuzz

CLEARANCE_FUZZ_TARGET(robot_files) {
  using namespace clearance;
  using namespace clearance::fuzz;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t zero = text.find('\0');
  try {
    RobotModel robot = parse_urdf(text.substr(0, zero), "robot.urdf");
    check_robot(robot);
    if (zero != std::string_view::npos) parse_srdf(text.substr(zero + 1), "robot.srdf", &robot);
    check_robot(robot);
    check_kinematics(robot);
    return true;
  } catch (const RobotError& error) {
    require(std::string_view(error.what()).starts_with("robot."), "an error names the file");
    require(std::string_view(error.what()).size() < 2000, "an error does not quote all of the file");
    return false;
  }
}
