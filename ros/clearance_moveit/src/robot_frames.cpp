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

using namespace moveit::core;

const std::string kRobot = "robot";

std::string name(const JointModel& joint) {
  return "joint" + std::to_string(joint.getJointIndex());
}
std::string name(const LinkModel& link) {
  return "link" + std::to_string(link.getLinkIndex());
}

std::invalid_argument unsupported(const JointModel& joint) {
  return std::invalid_argument("clearance_moveit: joint " + joint.getName() + " of type " + joint.getTypeName() +
                               " is not supported" + (joint.getParentLinkModel() ? " below the root" : ""));
}

void write(std::ostream& out, const char* attribute, const Eigen::Vector3d& v) {
  out << ' ' << attribute << "=\"" << v.x() << ' ' << v.y() << ' ' << v.z() << '"';
}

void write_joint(std::ostream& out, const JointModel& joint) {
  const bool turns = joint.getType() == JointModel::REVOLUTE, slides = joint.getType() == JointModel::PRISMATIC;
  if (!turns && !slides && joint.getType() != JointModel::FIXED) throw unsupported(joint);
  const Eigen::Isometry3d& X = joint.getChildLinkModel()->getJointOriginTransform();
  const char* type = turns ? "continuous" : slides ? "prismatic" : "fixed";
  out << "<joint name=\"" << name(joint) << "\" type=\"" << type << "\"><parent link=\""
      << name(*joint.getParentLinkModel()) << "\"/><child link=\"" << name(*joint.getChildLinkModel())
      << "\"/><limit lower=\"-1e6\" upper=\"1e6\" effort=\"1\" velocity=\"1\"/><origin";
  write(out, "xyz", X.translation());
  write(out, "rpy", X.linear().eulerAngles(2, 1, 0).reverse());
  out << "/><axis";
  if (turns) write(out, "xyz", static_cast<const RevoluteJointModel&>(joint).getAxis());
  if (slides) write(out, "xyz", static_cast<const PrismaticJointModel&>(joint).getAxis());
  out << "/></joint>\n";
}

bool is_continuous(const JointModel& joint) {
  return joint.getType() == JointModel::REVOLUTE && static_cast<const RevoluteJointModel&>(joint).isContinuous();
}

}  // namespace

RobotFrames::RobotFrames(const RobotModel& model) : root_(model.getRootJoint()) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(17);
  out << "<robot name=\"robot\">\n";
  for (const LinkModel* link : model.getLinkModels()) out << "<link name=\"" << name(*link) << "\"/>\n";
  for (const JointModel* joint : model.getJointModels()) {
    if (joint->getMimic() && is_continuous(*joint->getMimic())) is_straight_ = false;
    if (joint == root_) continue;
    write_joint(out, *joint);
    if (joint->getType() != JointModel::FIXED) variables_.push_back(joint);
  }
  urdf_ = out.str() + "</robot>\n";
  if (root_->getType() == JointModel::PLANAR)
    is_straight_ &= static_cast<const PlanarJointModel*>(root_)->getMotionModel() == PlanarJointModel::HOLONOMIC;
  else if (root_->getType() == JointModel::FIXED)
    root_ = nullptr;
  else if (root_->getType() != JointModel::FLOATING)
    throw unsupported(*root_);
}

clearance::Engine RobotFrames::make_engine() const {
  std::string path = std::filesystem::temp_directory_path() / "clearance_moveit_XXXXXX.urdf";
  const int file = mkstemps(path.data(), sizeof ".urdf" - 1);
  if (file < 0) throw std::runtime_error("clearance_moveit: no temporary file " + path);
  close(file);
  const auto remove = [&](void*) { std::filesystem::remove(path); };
  const std::unique_ptr<void, decltype(remove)> removed(&path, remove);
  std::ofstream(path) << urdf_;
  clearance::Scene scene;
  scene.add_robot(kRobot, {.urdf = path, .is_static = root_ == nullptr, .home = std::map<std::string, double>()});
  return clearance::Engine(std::move(scene), {.backend = "cpu", .threads = 1});
}

std::string RobotFrames::frame(const LinkModel& link) {
  return kRobot + "/" + name(link);
}

std::vector<std::uint32_t> RobotFrames::joints(const clearance::Engine& engine) const {
  std::vector<std::uint32_t> ids;
  for (const JointModel* joint : variables_) ids.push_back(engine.joints(kRobot + "/" + name(*joint)).ids.at(0));
  return ids;
}

std::vector<std::uint32_t> RobotFrames::movers(const clearance::Engine& engine) const {
  return root_ ? std::vector{engine.body(kRobot)} : std::vector<std::uint32_t>{};
}

void RobotFrames::append(const RobotState& state, Rows& rows) const {
  const double* values = state.getVariablePositions();
  for (const JointModel* joint : variables_) rows.positions.push_back(values[joint->getFirstVariableIndex()]);
  if (!root_) return;
  Eigen::Isometry3d X_wr;
  root_->computeTransform(values + root_->getFirstVariableIndex(), X_wr);
  rows.poses.push_back(clearance::eigen::pose(X_wr));
}

Rows RobotFrames::rows(const RobotState& from, const RobotState* to) const {
  Rows rows;
  append(from, rows);
  if (!to) return rows;
  append(*to, rows);
  for (std::size_t j = 0; j < variables_.size(); ++j) {
    double& end = rows.positions[variables_.size() + j];
    const double way = end - rows.positions[j];
    if (is_continuous(*variables_[j]) && std::abs(way) > std::numbers::pi)
      end -= std::copysign(2 * std::numbers::pi, way);  // the shorter way
  }
  return rows;
}

}  // namespace clearance_moveit
