#include "engine/scene/robot_files.h"

#include <cmath>

#include "engine/base/digest.h"
#include "engine/scene/body_checks.h"

namespace clearance {

namespace {

[[noreturn]] void fail_robot(const SceneRobot& robot, const std::string& what) {
  throw engine::SceneError("robot " + in_quotes(robot.name) + ": " + what);
}

template <class Value>
void check_links(const SceneRobot& robot, const std::string& what, const std::map<std::string, Value>& by_link) {
  for (const auto& [link, value] : by_link)
    if (robot.model.find_link(link) == kNone) fail_robot(robot, what + ": there is no link " + in_quotes(link));
}

// Links, joints and groups are named ROBOT/NAME, so the longest of their names limits that of the robot.
void check_names(const SceneRobot& robot) {
  const auto most = static_cast<std::size_t>(kMaxNameBytes);
  const std::string *longest = nullptr, *what = nullptr;
  const std::string kinds[] = {"link", "joint", "group"};
  const auto take = [&](const std::string& name, const std::string& kind) {
    if (!longest || name.size() > longest->size()) longest = &name, what = &kind;
  };
  for (const RobotLink& link : robot.model.links) take(link.name, kinds[0]);
  for (const RobotColumn& column : robot.model.columns) take(column.name, kinds[1]);
  for (const RobotGroup& group : robot.model.groups) take(group.name, kinds[2]);
  const std::size_t bytes = robot.name.size() + 1 + longest->size();
  if (bytes <= most) return;
  fail_robot(
      robot,
      "the " + *what + " " + in_quotes(*longest) + " would have the name " + in_quotes(robot.name + "/" + *longest) +
          " of " + std::to_string(bytes) + " bytes; names have at most " + std::to_string(most) + ": " +
          (longest->size() + 2 <= most ? "name the robot by at most " + std::to_string(most - 1 - longest->size()) +
                                             " bytes (name, in a scene file and of add_robot())"
                                       : "shorten it in the robot's files"));
}

void check_padding(const SceneRobot& robot, const engine::RobotOptions& options) {
  const auto check = [&](double metres, const std::string& of) {
    if (!(metres >= 0 && metres <= kMaxCoordinate))
      fail_robot(robot, "padding" + of + ": expected a number of metres >= 0, got " + std::to_string(metres));
  };
  check(options.padding, "");
  check_links(robot, "padding", options.link_padding);
  for (const auto& [link, metres] : options.link_padding) check(metres, " of " + in_quotes(link));
}

}  // namespace

std::shared_ptr<SceneRobot> read_robot_files(const std::string& name, const engine::RobotOptions& options) {
  try {
    std::string urdf = read_text(options.urdf), srdf;
    RobotModel model = parse_urdf(urdf, options.urdf);
    if (!options.srdf.empty()) {
      srdf = read_text(options.srdf);
      parse_srdf(srdf, options.srdf, &model);
    }
    auto robot = std::make_shared<SceneRobot>(name, std::move(model));
    robot->urdf = std::move(urdf);
    robot->srdf = std::move(srdf);
    return robot;
  } catch (const RobotError& e) {
    throw engine::SceneError(e.what());
  }
}

void check_robot_options(const SceneRobot& robot, const engine::RobotOptions& options) {
  check_names(robot);
  check_padding(robot, options);
  check_links(robot, "uncertainty", options.link_uncertainty);
  check_links(robot, "mesh_as", options.link_mesh_as);
  if (options.geometry_files) check_links(robot, "geometry", *options.geometry_files);
}

std::vector<std::optional<double>> home_positions(const SceneRobot& robot, const engine::RobotOptions& options) {
  const RobotModel& model = robot.model;
  std::vector<std::optional<double>> home(model.columns.size());
  if (!options.home && options.home_state.empty()) return home;
  if (!options.home_state.empty()) {
    bool found = false;
    for (const GroupState& state : model.states) {
      if (state.name != options.home_state) continue;
      found = true;
      for (const auto& [column, position] : state.positions) home[column] = position;
    }
    if (!found) fail_robot(robot, "home: its SRDF has no group state " + in_quotes(options.home_state));
  } else {
    for (const auto& [joint, position] : *options.home) {
      const std::uint32_t column = model.find_column(joint);
      if (column == kNone) fail_robot(robot, "home: there is no joint " + in_quotes(joint) + " that takes a position");
      home[column] = position;
    }
  }
  for (std::uint32_t c = 0; c < home.size(); ++c) {
    const RobotColumn& column = model.columns[c];
    if (home[c]) {
      if (std::abs(*home[c]) <= kMaxPosition) continue;
      fail_robot(robot, "home: " + in_quotes(column.name) + ": expected a number from -1e6 to 1e6, got " +
                            std::to_string(*home[c]));
    }
    if (!(column.lower <= 0 && 0 <= column.upper))
      fail_robot(robot, "home: " + in_quotes(column.name) + " is not named, and 0 is beyond its limits (" +
                            std::to_string(column.lower) + " to " + std::to_string(column.upper) + ")");
    home[c] = 0;
  }
  return home;
}

std::uint64_t digest_of(const SceneRobot& robot) {
  Digest digest;
  digest.add(std::string_view(robot.name));
  digest.add(std::uint64_t{robot.first_joint});
  for (const RobotColumn& column : robot.model.columns) {
    digest.add(std::string_view(column.name));
    digest.add(column.lower);
    digest.add(column.upper);
  }
  for (const KinematicStep& step : robot.kinematics.steps()) {
    digest.add(static_cast<std::uint64_t>(step.kind) << 32 | step.from);
    digest.add(std::uint64_t{step.link} << 32 | step.column);
    digest.add(std::uint64_t{step.mimics});
    for (const double x : {step.multiplier, step.offset}) digest.add(x);
    for (const Quaternion<double>& q : {step.still, step.turning})
      for (const double x : {q.w, q.x, q.y, q.z}) digest.add(x);
    for (const Vec3d& v : {step.at, step.along[0], step.along[1]}) digest.add(v);
  }
  return digest.value();
}

}  // namespace clearance
