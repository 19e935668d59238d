// Where joint positions put the links of a robot, each in the frame of the body that it follows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/scene_robot.h"

namespace clearance {

/// What is to be said of a link beside its pose, as bits.
enum LinkFact : std::uint8_t {
  kLinkUnplaced = 1,      ///< a joint on the way to it has no position
  kLinkBeyondLimits = 2,  ///< a joint on the way to it is beyond its limits
  kLinkBad = 4,           ///< a position on the way to it is no number, or beyond kMaxPosition: its pose is NaN
};

/// Some joints of one robot move, and its others stay where they are. Immutable; any number of threads may use one.
class LinkMotion {
 public:
  /// A joint that moves: a column of the robot, and where a row has its position.
  struct Moving {
    std::uint32_t column, at;
  };
  struct Scratch {
    std::vector<double> positions;
    std::vector<Pose> poses;
    std::vector<Status> status;
    std::vector<std::uint8_t> strange;  // rows with facts of their own
    std::vector<double> travels;        // of all links
  };

  /// All links that joints place, where the joints stand.
  LinkMotion(const SceneRobot& robot, std::span<const double> positions, std::span<const std::uint8_t> given);
  /// \param positions, given of all columns. \param moving without repeats
  LinkMotion(const SceneRobot& robot, std::span<const double> positions, std::span<const std::uint8_t> given,
             std::vector<Moving> moving);

  /// Those that the moving joints move, ascending.
  const std::vector<std::uint32_t>& links() const { return links_; }
  const std::vector<Moving>& moving() const { return moving_; }
  const SceneRobot& robot() const { return *robot_; }
  /// What the kernels of a device make links of: of each column where it stays, 0 where there is no position that can
  /// be used, and LinkFact bits. Of a moving one the facts are 0.
  std::span<const double> positions() const { return positions_; }
  std::span<const std::uint8_t> column_facts() const { return column_facts_; }

  /// \param rows (count, J) positions. \param poses of links() of row k from k * stride on. \param facts LinkFact bits,
  /// likewise
  void make(std::span<const double> rows, std::size_t count, Pose* poses, std::uint8_t* facts, std::size_t stride,
            Scratch& scratch) const;
  /// Kinematics::travels() of links() in row k of those that make() placed last. \param travels (links(),)
  void travels(std::size_t k, double* travels, Scratch& scratch) const;

 private:
  void take_positions(std::span<const double> positions, std::span<const std::uint8_t> given);
  std::vector<std::uint8_t> row_facts(std::span<const double> row) const;

  const SceneRobot* robot_;
  std::vector<Moving> moving_;
  std::vector<double> positions_;           // of all columns; 0 where there is none that can be used
  std::vector<std::uint8_t> column_facts_;  // of those that stay
  std::vector<std::uint8_t> link_facts_;    // of links(), through joints that stay
  std::vector<std::uint32_t> links_;
};

/// By link: what `join` makes of all columns on the way to it; T() where there are none.
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

/// What a position says of its column, whose limits these are.
CLEARANCE_HD inline std::uint8_t position_fact(double lower, double upper, double position) {
  if (!(-kMaxPosition <= position && position <= kMaxPosition)) return kLinkBad;
  return position < lower || position > upper ? kLinkBeyondLimits : 0;
}
inline std::uint8_t position_fact(const RobotColumn& column, double position) {
  return position_fact(column.lower, column.upper, position);
}

}  // namespace clearance
