// The pairs of links that a table can be made for.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "engine/hull/primitive.h"
#include "engine/joint_table/joint_table_maker.h"
#include "engine/scene/body_ball.h"

namespace clearance {

namespace {

constexpr double kMostTurned = 64;  // radians, of joints that turn without end

// Whether positions of a column that differ by a turn place all links alike.
bool repeats(const Kinematics& robot, std::uint32_t column) {
  return std::all_of(robot.steps().begin(), robot.steps().end(), [&](const KinematicStep& step) {
    return step.kind == KinematicStep::Kind::kFixed || step.column != column ||
           (step.kind == KinematicStep::Kind::kTurning && !step.mimics);
  });
}

}  // namespace

std::optional<TableColumn> table_column(const SceneRobot& robot, std::uint32_t c) {
  const RobotColumn& limits = robot.model.columns[c];
  TableColumn column;
  column.column = c;
  const bool is_limited = std::isfinite(limits.lower) && std::isfinite(limits.upper);
  if (repeats(robot.kinematics, c) && (!is_limited || limits.upper - limits.lower > 2 * std::numbers::pi)) {
    column.least = -kMostTurned, column.most = kMostTurned;
    column.begin = -std::numbers::pi;
    column.turns_per_cell = 1;
    return column;
  }
  const auto& steps = robot.kinematics.steps();
  const bool is_angle = std::none_of(steps.begin(), steps.end(), [&](const KinematicStep& step) {
    return step.kind == KinematicStep::Kind::kSliding && step.column == c;
  });
  if (!is_limited && !is_angle) return {};
  column.least = is_limited ? limits.lower : -std::numbers::pi;
  column.most = is_limited ? limits.upper : std::numbers::pi;
  column.begin = column.least;
  return column;
}

TableLink TableLink::of(const Body& body) {
  return {body.link, body.parts, ball_around(body), extent_of(body)};
}

std::vector<std::uint32_t> columns_between(const Kinematics& robot, std::uint32_t a, std::uint32_t b) {
  std::vector<std::uint32_t> columns;
  const MotionPath path(robot, a, b, {});
  for (const Mover& mover : path.movers()) columns.push_back(mover.column);
  std::sort(columns.begin(), columns.end());
  columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  return columns;
}

std::optional<TablePair> table_pair(const std::shared_ptr<const SceneRobot>& robot, const Body& a, const Body& b) {
  constexpr std::size_t kMostPartPairs = 256;
  const auto is_usable = [](const Body& body) {
    return body.robot != kNone && !body.parts.empty() && !is_cloud(body) &&
           std::none_of(body.parts.begin(), body.parts.end(), [](const auto& part) { return is_half_space(*part); });
  };
  if (!is_usable(a) || !is_usable(b) || a.parts.size() * b.parts.size() > kMostPartPairs ||
      robot->kinematics.root_of(a.link) != robot->kinematics.root_of(b.link))
    return {};
  std::vector<std::uint32_t> columns = columns_between(robot->kinematics, a.link, b.link);
  if (columns.empty() || columns.size() > 2) return {};
  for (const std::uint32_t c : columns)
    if (!table_column(*robot, c)) return {};
  return TablePair{robot, TableLink::of(a), TableLink::of(b), std::move(columns)};
}

}  // namespace clearance
