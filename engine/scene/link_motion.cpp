#include "engine/scene/link_motion.h"

#include <algorithm>
#include <cassert>
#include <functional>
#include <limits>

namespace clearance {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr Pose kBadPose{{kNaN, kNaN, kNaN}, kNaN, kNaN, kNaN, kNaN};

}  // namespace

std::vector<std::uint8_t> bits_along_links(const SceneRobot& robot, std::span<const std::uint8_t> of_columns) {
  return along_links(robot, of_columns, std::bit_or<std::uint8_t>());
}

LinkMotion::LinkMotion(const SceneRobot& robot, std::span<const double> positions, std::span<const std::uint8_t> given)
    : robot_(&robot) {
  take_positions(positions, given);
  const std::vector<std::uint8_t> facts = bits_along_links(robot, column_facts_);
  for (std::uint32_t link = 0; link < facts.size(); ++link)
    if (robot.places(link)) {
      links_.push_back(link);
      link_facts_.push_back(facts[link]);
    }
}

LinkMotion::LinkMotion(const SceneRobot& robot, std::span<const double> positions, std::span<const std::uint8_t> given,
                       std::vector<Moving> moving)
    : robot_(&robot), moving_(std::move(moving)) {
  take_positions(positions, given);
  std::vector<std::uint8_t> moves(positions.size(), 0);
  for (const Moving& m : moving_) {
    moves[m.column] = 1;
    column_facts_[m.column] = 0;
  }
  const std::vector<std::uint8_t> is_moved = bits_along_links(robot, moves),
                                  facts = bits_along_links(robot, column_facts_);
  for (std::uint32_t link = 0; link < is_moved.size(); ++link)
    if (is_moved[link]) {
      links_.push_back(link);
      link_facts_.push_back(facts[link]);
    }
}

void LinkMotion::take_positions(std::span<const double> positions, std::span<const std::uint8_t> given) {
  const std::vector<RobotColumn>& columns = robot_->model.columns;
  assert(positions.size() == columns.size() && given.size() == positions.size());
  positions_.assign(positions.begin(), positions.end());
  for (std::size_t c = 0; c < positions.size(); ++c) {
    column_facts_.push_back(given[c] ? position_fact(columns[c], positions[c]) : std::uint8_t{kLinkUnplaced});
    if (column_facts_[c] & (kLinkUnplaced | kLinkBad)) positions_[c] = 0;
  }
}

// By link.
std::vector<std::uint8_t> LinkMotion::row_facts(std::span<const double> row) const {
  std::vector<std::uint8_t> facts = column_facts_;
  for (const Moving& m : moving_) facts[m.column] = position_fact(robot_->model.columns[m.column], row[m.at]);
  return bits_along_links(*robot_, facts);
}

void LinkMotion::make(std::span<const double> rows, std::size_t count, Pose* poses, std::uint8_t* facts,
                      std::size_t stride, LinkScratch& scratch) const {
  const Kinematics& kinematics = robot_->kinematics;
  const std::size_t columns = positions_.size(), links = kinematics.links(), width = rows.size() / count;
  assert(rows.size() == count * width);
  scratch.positions.resize(count * columns);
  scratch.poses.resize(count * links);
  scratch.status.resize(count);
  scratch.has_facts.assign(count, 0);
  for (std::size_t k = 0; k < count; ++k) {
    double* const row = scratch.positions.data() + k * columns;
    std::copy(positions_.begin(), positions_.end(), row);
    for (const Moving& m : moving_) {
      const double position = rows[k * width + m.at];
      const std::uint8_t fact = position_fact(robot_->model.columns[m.column], position);
      scratch.has_facts[k] |= fact;
      row[m.column] = fact & kLinkBad ? 0 : position;
    }
  }
  kinematics.place(scratch.positions, {}, scratch.poses, scratch.status);  // relative to the links' roots
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<std::uint8_t> own;
    if (scratch.has_facts[k]) own = row_facts(rows.subspan(k * width, width));
    for (std::size_t i = 0; i < links_.size(); ++i) {
      const std::uint8_t fact = scratch.has_facts[k] ? own[links_[i]] : link_facts_[i];
      poses[k * stride + i] = fact & kLinkBad ? kBadPose : scratch.poses[k * links + links_[i]];
      facts[k * stride + i] = fact;
    }
  }
}

void LinkMotion::travels(std::size_t k, double* travels, LinkScratch& scratch) const {
  const std::size_t columns = positions_.size();
  scratch.travels.resize(robot_->kinematics.links());
  robot_->kinematics.travels(std::span(scratch.positions).subspan(k * columns, columns), scratch.travels);
  for (std::size_t i = 0; i < links_.size(); ++i) travels[i] = scratch.travels[links_[i]];
}

}  // namespace clearance
