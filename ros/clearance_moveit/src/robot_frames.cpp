#include "robot_frames.h"

#include <clearance/eigen.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <locale>
#include <map>
#include <moveit/robot_model/planar_joint_model.hpp>
#include <moveit/robot_model/prismatic_joint_model.hpp>
#include <moveit/robot_model/revolute_joint_model.hpp>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace clearance_moveit {
namespace {

using moveit::core::JointModel;

constexpr const char* kRobot = "robot";
constexpr double kUnlimited = 1e6;  // metres

std::string name(const JointModel& joint) {
  return "joint" + std::to_string(joint.getJointIndex());
}
std::string name(const moveit::core::LinkModel& link) {
  return "link" + std::to_string(link.getLinkIndex());
}

/// A file of this text, removed with this.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text) {
    folder_ = (std::filesystem::temp_directory_path() / "clearance_moveit_XXXXXX").string();
    if (!mkdtemp(folder_.data())) throw std::runtime_error("clearance_moveit: no temporary folder " + folder_);
    std::ofstream(path()) << text;
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  std::string path() const { return folder_ + "/robot.urdf"; }

 private:
  std::string folder_;
};

void write_axis(std::ostream& out, const Eigen::Vector3d& axis) {
  out << "<axis xyz=\"" << axis.x() << ' ' << axis.y() << ' ' << axis.z() << "\"/>";
}

void write_joint(std::ostream& out, const JointModel& joint) {
  const bool turns = joint.getType() == JointModel::REVOLUTE, slides = joint.getType() == JointModel::PRISMATIC;
  if (!turns && !slides && joint.getType() != JointModel::FIXED)
    throw std::invalid_argument("clearance_moveit: joint " + joint.getName() + ": a joint of type " +
                                joint.getTypeName() + " is supported at the root only");
  const Eigen::Isometry3d& X = joint.getChildLinkModel()->getJointOriginTransform();
  const Eigen::Vector3d angles = X.linear().eulerAngles(2, 1, 0);
  out << "<joint name=\"" << name(joint) << "\" type=\""
      << (turns    ? "continuous"
          : slides ? "prismatic"
                   : "fixed")
      << "\"><parent link=\"" << name(*joint.getParentLinkModel()) << "\"/><child link=\""
      << name(*joint.getChildLinkModel()) << "\"/><origin xyz=\"" << X.translation().x() << ' ' << X.translation().y()
      << ' ' << X.translation().z() << "\" rpy=\"" << angles[2] << ' ' << angles[1] << ' ' << angles[0] << "\"/>";
  if (turns) write_axis(out, static_cast<const moveit::core::RevoluteJointModel&>(joint).getAxis());
  if (slides) {
    write_axis(out, static_cast<const moveit::core::PrismaticJointModel&>(joint).getAxis());
    out << "<limit lower=\"" << -kUnlimited << "\" upper=\"" << kUnlimited << "\" effort=\"1\" velocity=\"1\"/>";
  }
  out << "</joint>\n";
}

bool is_continuous(const JointModel& joint) {
  return joint.getType() == JointModel::REVOLUTE &&
         static_cast<const moveit::core::RevoluteJointModel&>(joint).isContinuous();
}

}  // namespace

RobotFrames::RobotFrames(const moveit::core::RobotModel& model) : root_(model.getRootJoint()) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(17);
  out << "<robot name=\"robot\">\n";
  for (const auto* link : model.getLinkModels()) out << "<link name=\"" << name(*link) << "\"/>\n";
  for (const JointModel* joint : model.getJointModels()) {
    if (joint->getMimic() && is_continuous(*joint->getMimic())) is_straight_ = false;
    if (joint == root_) continue;
    write_joint(out, *joint);
    if (joint->getType() != JointModel::FIXED) variables_.push_back(joint);
  }
  out << "</robot>\n";
  urdf_ = out.str();
  if (root_->getType() == JointModel::FIXED)
    root_ = nullptr;
  else if (root_->getType() != JointModel::PLANAR && root_->getType() != JointModel::FLOATING)
    throw std::invalid_argument("clearance_moveit: joint " + root_->getName() + ": a root of type " +
                                root_->getTypeName() + " is not supported");
  else if (root_->getType() == JointModel::PLANAR)
    is_straight_ &= static_cast<const moveit::core::PlanarJointModel*>(root_)->getMotionModel() ==
                    moveit::core::PlanarJointModel::HOLONOMIC;
}

clearance::Engine RobotFrames::make_engine() const {
  const TemporaryFile file(urdf_);
  clearance::Scene scene;
  scene.add_robot(kRobot,
                  {.urdf = file.path(), .is_static = root_ == nullptr, .home = std::map<std::string, double>()});
  return clearance::Engine(std::move(scene), {.backend = "cpu", .threads = 1});
}

std::string RobotFrames::frame(const moveit::core::LinkModel& link) {
  return std::string(kRobot) + "/" + name(link);
}

std::vector<std::uint32_t> RobotFrames::joints(const clearance::Engine& engine) const {
  std::vector<std::uint32_t> ids;
  for (const JointModel* joint : variables_)
    ids.push_back(engine.joints(std::string(kRobot) + "/" + name(*joint)).ids.at(0));
  return ids;
}

std::vector<std::uint32_t> RobotFrames::bodies(const clearance::Engine& engine) const {
  return root_ ? std::vector{engine.body(kRobot)} : std::vector<std::uint32_t>{};
}

void RobotFrames::append(const moveit::core::RobotState& state, Rows& rows) const {
  const double* values = state.getVariablePositions();
  for (const JointModel* joint : variables_) rows.positions.push_back(values[joint->getFirstVariableIndex()]);
  if (!root_) return;
  Eigen::Isometry3d X_wr;
  root_->computeTransform(values + root_->getFirstVariableIndex(), X_wr);
  rows.poses.push_back(clearance::eigen::pose(X_wr));
}

Rows RobotFrames::rows(const moveit::core::RobotState& state) const {
  Rows rows;
  append(state, rows);
  return rows;
}

Rows RobotFrames::motion(const moveit::core::RobotState& from, const moveit::core::RobotState& to) const {
  Rows rows;
  append(from, rows);
  append(to, rows);
  const std::size_t each = variables_.size();
  for (std::size_t j = 0; j < each; ++j) {
    if (!is_continuous(*variables_[j])) continue;
    double& end = rows.positions[each + j];
    const double way = end - rows.positions[j];
    if (std::abs(way) > std::numbers::pi) end -= std::copysign(2 * std::numbers::pi, way);  // the shorter way
  }
  return rows;
}

}  // namespace clearance_moveit
