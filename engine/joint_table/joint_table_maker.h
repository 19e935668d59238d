// Makes joint tables.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "engine/hull/convex_part.h"
#include "engine/joint_table/joint_table.h"
#include "engine/robot/motion_path.h"
#include "engine/scene/scene.h"

namespace clearance {

/// A link of a pair.
struct TableLink {
  std::uint32_t link = 0;
  std::vector<ConvexPartPtr> parts;
  LinkBall ball;      ///< contains the points of the parts, link axes
  double extent = 0;  ///< bound on their distance from the link's origin, metres

  static TableLink of(const Body& body);
};

/// Two links of one robot for which a table can be made.
struct TablePair {
  std::shared_ptr<const SceneRobot> robot;
  TableLink a, b;
  std::vector<std::uint32_t> columns;  ///< one or two, ascending: those that move the links relative to each other
};

/// The range of a column, without cells. Nothing for one that slides without limits.
std::optional<TableColumn> table_column(const SceneRobot& robot, std::uint32_t column);
/// The columns that move two links of a robot relative to each other, ascending.
std::vector<std::uint32_t> columns_between(const Kinematics& robot, std::uint32_t a, std::uint32_t b);
/// Returns nothing for links without bounded parts, with clouds, with more or fewer joints between them, under different
/// roots, or with a joint between them that slides without limits.
std::optional<TablePair> table_pair(const std::shared_ptr<const SceneRobot>& robot, const Body& a, const Body& b);

/// The table of a pair without bounds: no positions are within any cell.
JointTable empty_joint_table(const TablePair& pair);
/// \param stopped makes it return nothing once it is set; may be null
std::optional<JointTable> make_joint_table(const TablePair& pair, const std::atomic<bool>* stopped = nullptr);

}  // namespace clearance
