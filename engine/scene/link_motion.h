// Poses of a robot's links from joint positions, each in the frame of the body that it follows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/scene_robot.h"

namespace clearance {

/// Facts about a link in addition to its pose, as bits.
enum LinkFact : std::uint8_t {
  kLinkUnplaced = 1,      ///< a joint on the way to it has no position
  kLinkBeyondLimits = 2,  ///< a joint on the way to it is beyond its limits
  kLinkBad = 4,           ///< a position on the way to it is NaN or beyond kMaxPosition, so its pose is NaN
};

/// Motion of some joints of a robot while its others stay. Immutable and thread-safe.
class LinkMotion {
 public:
  /// A moving joint: a column of the robot, and its index in a row of positions.
  struct Moving {
    std::uint32_t column, at;
  };
  struct LinkScratch {
    std::vector<double> positions;
    std::vector<Pose> poses;
    std::vector<Status> status;
    std::vector<std::uint8_t> has_facts;  // rows with facts of their own
    std::vector<double> travels;          // of all links
  };

  /// Places all links at the given positions.
  LinkMotion(const SceneRobot& robot, std::span<const double> positions, std::span<const std::uint8_t> given);
  /// \param positions, given of all columns
  /// \param moving without repeats
  LinkMotion(const SceneRobot& robot, std::span<const double> positions, std::span<const std::uint8_t> given,
             std::vector<Moving> moving);

  /// Links that the moving joints move, ascending.
  const std::vector<std::uint32_t>& links() const { return links_; }
  const std::vector<Moving>& moving() const { return moving_; }
  const SceneRobot& robot() const { return *robot_; }
  /// Input of the device kernels: the position of each column that stays, or 0 without a usable one, and its LinkFact
  /// bits. The facts of moving columns are 0.
  std::span<const double> positions() const { return positions_; }
  std::span<const std::uint8_t> column_facts() const { return column_facts_; }

  /// Computes links() for `count` rows.
  /// \param rows (count, J) positions
  /// \param poses of links() of row k, from k * stride on
  /// \param facts LinkFact bits, likewise
  void make(std::span<const double> rows, std::size_t count, Pose* poses, std::uint8_t* facts, std::size_t stride,
            LinkScratch& scratch) const;
  /// Kinematics::travels() of links() in row k of the last make().
  /// \param travels (links(),)
  void travels(std::size_t k, double* travels, LinkScratch& scratch) const;

 private:
  void take_positions(std::span<const double> positions, std::span<const std::uint8_t> given);
  std::vector<std::uint8_t> row_facts(std::span<const double> row) const;

  const SceneRobot* robot_;
  std::vector<Moving> moving_;
  std::vector<double> positions_;           // of all columns; 0 without a usable one
  std::vector<std::uint8_t> column_facts_;  // of columns that stay
  std::vector<std::uint8_t> link_facts_;    // of links(), through joints that stay
  std::vector<std::uint32_t> links_;
};

/// By link: all columns on the way to it combined by `join`, or T() without any.
template <class T, class Join>
std::vector<T> along_links(const SceneRobot& robot, std::span<const T> of_columns, Join join) {
  std::vector<T> links(robot.kinematics.links()), frames(robot.kinematics.roots().size());
  for (const KinematicStep& step : robot.kinematics.steps()) {
    using Kind = KinematicStep::Kind;
    T here = frames[step.from];
    const std::uint32_t width = step.kind == Kind::kFixed ? 0 : step.kind == Kind::kPlanar ? 3 : 1;
    for (std::uint32_t c = 0; c < width; ++c) here = join(here, of_columns[step.column + c]);
    frames.push_back(here);
    links[step.link] = here;
  }
  return links;
}

/// By link: the bits of all columns on the way to it.
std::vector<std::uint8_t> bits_along_links(const SceneRobot& robot, std::span<const std::uint8_t> of_columns);

/// Facts about a position, given the limits of its column.
CLEARANCE_HD inline std::uint8_t position_fact(double lower, double upper, double position) {
  if (!(-kMaxPosition <= position && position <= kMaxPosition)) return kLinkBad;
  return position < lower || position > upper ? kLinkBeyondLimits : 0;
}
inline std::uint8_t position_fact(const RobotColumn& column, double position) {
  return position_fact(column.lower, column.upper, position);
}

}  // namespace clearance
