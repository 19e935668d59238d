// Joint tables: bounds of cells and of rectangles hold the exact distance, everywhere in the cells and at their seams.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "engine/bvh/surface.h"
#include "engine/joint_table/joint_table_maker.h"
#include "engine/joint_table/joint_table_record.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/decision/two_links.h"
#include "tests/oracle/exact/exact_surface.h"

namespace clearance::exact {
namespace {

using test::Real;

// Signed distance of links that are balls, without the rounding of joints.
double distance_of_balls(const TwoLinks& links, const std::vector<TableBall>& of_base,
                         const std::vector<TableBall>& of_tip, const Positions& at) {
  const std::vector<test::RealFrame> frames = links.frames(at);
  Real least = 1e9;
  const auto place = [](const test::RealFrame& X, const Vec3d& v) { return (X * test::real_shift(v.x, v.y, v.z)).t; };
  for (const TableBall& a : of_base)
    for (const TableBall& b : of_tip) {
      const test::RealVec p = place(frames[0], a.centre), q = place(frames[1], b.centre);
      Real sum = 0;
      for (int k = 0; k < 3; ++k) sum += (p.x[k] - q.x[k]) * (p.x[k] - q.x[k]);
      least = std::min(least, Real(sqrt(sum) - a.radius - b.radius));
    }
  return static_cast<double>(least);
}

/// Counts positions whose distance a bound excludes. Distances are rounded to float64.
struct Wrong {
  int low = 0, high = 0, bounded = 0;
  void take(TableCell cell, double distance) {
    constexpr double kRounding = 1e-14;
    bounded += cell.low != TableCell::kNoLow && cell.high != TableCell::kNoHigh;
    low += cell.low != TableCell::kNoLow && cell.low * JointTable::kUnit > distance + kRounding;
    high += cell.high != TableCell::kNoHigh && cell.high * JointTable::kUnit < distance - kRounding;
  }
  void expect_none(int least_bounded) const {
    EXPECT_EQ(low, 0);
    EXPECT_EQ(high, 0);
    EXPECT_GT(bounded, least_bounded);
  }
};

double width_of(const TableColumn& column) {
  return 1 / column.cells_per_unit;
}
// A position in a random cell: anywhere, at a seam, or very near one.
double position_in(const TableColumn& column, test::RobotRandom& random) {
  if (column.shift == 0) return 0;
  const int cell = random.below(static_cast<int>(column.count()));
  const double in_cell[] = {0, 1e-13, 1 - 1e-13, 1, random.uniform(0, 1)};
  const double q = column.begin + (cell + in_cell[random.below(5)]) * width_of(column);
  if (column.turns_per_cell > 0) return q + 2 * std::numbers::pi * (random.below(7) - 3);
  return std::clamp(q, column.least, column.most);
}

template <class Distance>
void check_table(const JointTable& table, int samples, int least_bounded, const Distance& distance) {
  test::RobotRandom random(5);
  Wrong at, over;
  for (int n = 0; n < samples; ++n) {
    const Positions q{position_in(table.columns[0], random), position_in(table.columns[1], random)};
    const double d = distance(q);
    at.take(table.at(q), d);
    // A rectangle around it, of up to 40 cells.
    Positions low = q, high = q;
    for (std::size_t c = 0; c < table.column_count; ++c) {
      const TableColumn& column = table.columns[c];
      low[c] = std::max(q[c] - random.uniform(0, 20) * width_of(column), column.least);
      high[c] = std::min(q[c] + random.uniform(0, 20) * width_of(column), column.most);
    }
    over.take(table.over(low, high), d);
  }
  at.expect_none(least_bounded);
  over.expect_none(least_bounded / 4);
}

const std::vector<TableBall> kPin{{{0.3, 0, 0}, 0.0001}};

// The tip moves straight away from the base: bounds have nothing to spare.
TEST(JointTable, HoldsForOneJoint) {
  const TwoLinks links(link("base", shapes(kPin)) + link("tip", shapes(kPin)) +
                       joint("j", "revolute", "base", "tip", "0 0 0", "0 0 1", limits(-0.5, 0.5)));
  ASSERT_TRUE(links.pair());
  const JointTable table = *make_joint_table(*links.pair());
  EXPECT_EQ(table.column_count, 1u);
  EXPECT_EQ(table.columns[0].count(), 4096u);
  check_table(table, 20000, 5000, [&](const Positions& q) { return distance_of_balls(links, kPin, kPin, q); });
  EXPECT_EQ(table.at({0.51, 0}).low, TableCell::kNoLow);
  EXPECT_EQ(table.at({std::nan(""), 0}).high, TableCell::kNoHigh);
}

// Unions of balls, joints that turn without end, and a link between them whose own joint does not matter.
TEST(JointTable, HoldsForTwoJointsThatTurn) {
  const std::vector<TableBall> base{{{0, 0, 0.05}, 0.08}, {{0.1, 0.05, 0.3}, 0.04}},
      tip{{{0.2, 0, 0}, 0.05}, {{0.05, 0.1, 0.02}, 0.03}, {{-0.1, 0, 0.1}, 0.06}};
  const TwoLinks links(link("root") + link("base", shapes(base)) + link("mid") + link("tip", shapes(tip)) +
                       joint("first", "continuous", "root", "base", "0 0 1", "0 1 0") +
                       joint("j", "continuous", "base", "mid", "0.1 0 0.1", "0 0 1") +
                       joint("k", "revolute", "mid", "tip", "0.2 0 0", "0 1 0.2", limits(-6, 6)));
  ASSERT_TRUE(links.pair());
  const JointTable table = *make_joint_table(*links.pair());
  ASSERT_EQ(table.column_count, 2u);
  EXPECT_EQ(table.columns[0].column, 1u);
  EXPECT_EQ(table.cells.size(), table.level_begin(table.levels()));
  check_table(table, 4000, 1000, [&](const Positions& q) { return distance_of_balls(links, base, tip, q); });
  const auto decided = std::count_if(table.cells.begin(), table.cells.begin() + 65536,
                                     [](TableCell cell) { return cell.low > 0 || cell.high < 0; });
  EXPECT_GT(decided, 65536 * 95 / 100);
}

TEST(JointTable, HoldsForASlidingJointAndAMimic) {
  const std::vector<TableBall> base{{{0.4, 0.1, 0}, 0.05}}, tip{{{0.1, 0, 0}, 0.02}, {{0.2, 0.02, 0}, 0.03}};
  const TwoLinks links(link("base", shapes(base)) + link("mid") + link("out") + link("tip", shapes(tip)) +
                       joint("j", "revolute", "base", "mid", "0 0 0", "0 0 1", limits(-1, 1)) +
                       joint("slide", "prismatic", "mid", "out", "0.05 0 0", "2 0 0", limits(-0.1, 0.4)) +
                       joint("copy", "revolute", "out", "tip", "0 0 0", "0 0 1",
                             limits(-3, 3) + "<mimic joint='j' multiplier='-1.5' offset='0.2'/>"));
  ASSERT_TRUE(links.pair());
  const JointTable table = *make_joint_table(*links.pair());
  EXPECT_EQ(table.column_count, 2u);
  EXPECT_EQ(table.columns[1].least, -0.1);
  check_table(table, 4000, 1000, [&](const Positions& q) { return distance_of_balls(links, base, tip, q); });
}

// Boxes, whose depth is exact as well.
TEST(JointTable, HoldsForHulls) {
  const auto box = [](const std::string& origin, const std::string& size) {
    return "<collision><origin xyz='" + origin + "'/><geometry><box size='" + size + "'/></geometry></collision>";
  };
  const TwoLinks links(link("base", box("0.1 0 0", "0.2 0.1 0.1")) + link("mid") +
                       link("tip", box("0.15 0 0", "0.3 0.06 0.04")) +
                       joint("j", "revolute", "base", "mid", "0.1 0 0.12", "0 0 1", limits(-1.5, 1.5)) +
                       joint("k", "revolute", "mid", "tip", "0 0 0", "0 1 0", limits(-1, 1)));
  ASSERT_TRUE(links.pair());
  const JointTable table = *make_joint_table(*links.pair());
  const Kinematics& robot = links.pair()->robot->kinematics;
  std::vector<Pose> poses(robot.links());
  int deep = 0;
  check_table(table, 1500, 300, [&](const Positions& q) {
    std::vector<Status> status(1);
    robot.place(q, std::vector<Pose>(1), poses, status);
    const auto view = [](const TableLink& l) { return ConvexPartView{l.parts[0]->vertices, l.parts[0]->radius}; };
    const double d = exact_distance(view(links.pair()->a), poses[links.pair()->a.link], view(links.pair()->b),
                                    poses[links.pair()->b.link])
                         .distance.lower();
    deep += d < -0.01;
    return d;
  });
  EXPECT_GT(deep, 50);
}

std::string as_obj(const Mesh& mesh) {
  std::ostringstream text;
  text.precision(17);
  for (const Vec3d& v : mesh.vertices) text << "v " << v.x << ' ' << v.y << ' ' << v.z << '\n';
  for (const Triangle& t : mesh.triangles) text << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  return text.str();
}

// A block turns about a ring, into the hole and through the wall; it is within the wall of a cavity, too.
TEST(JointTable, HoldsForMeshes) {
  Mesh frame = box_mesh({0.2, 0.2, 0.05});
  append(frame, flipped(box_mesh({0.15, 0.15, 0.04})));
  const TwoLinks links(
      link("base", "<collision><geometry><mesh filename='frame.obj'/></geometry></collision>") + link("mid") +
          link("tip", "<collision><geometry><mesh filename='bar.obj'/></geometry></collision>") +
          joint("j", "revolute", "base", "mid", "0.05 0 0", "0 0 1", limits(-1.5, 1.5)) +
          joint("k", "prismatic", "mid", "tip", "0 0 0", "1 0.25 0", limits(0, 0.4)),
      {{"frame.obj", as_obj(frame)},
       {"bar.obj",
        as_obj(scaled(bent_bar(std::vector<Point2>{{0, 0}, {1, 0}, {1, 1}}, 0.25, 0.25), {0.03, 0.03, 0.03}))}});
  ASSERT_TRUE(links.pair());
  ASSERT_TRUE(has_surface(links.body("base")) && has_surface(links.body("tip")));
  const JointTable table = *make_joint_table(*links.pair());
  const Kinematics& robot = links.pair()->robot->kinematics;
  std::vector<Pose> poses(robot.links());
  std::vector<Status> status(1);
  const auto view = [](const TableLink& l) {
    const Surface& mesh = *l.parts[0]->surface;
    return BodyView{mesh.vertices(), mesh.triangles(), true, 0};
  };
  test::RobotRandom random(6);
  int apart = 0, touching = 0, free = 0;
  for (int n = 0; n < 1500; ++n) {
    const Positions q{position_in(table.columns[0], random), position_in(table.columns[1], random)};
    robot.place(q, std::vector<Pose>(1), poses, status);
    const double d = exact_distance(view(links.pair()->a), poses[links.pair()->a.link], view(links.pair()->b),
                                    poses[links.pair()->b.link])
                         .distance.lower();
    ++(d > 0 ? apart : touching);
    const TableCell cell = table.at(q);
    free += cell.low > 0;
    ASSERT_LE(cell.low * JointTable::kUnit, cell.low == TableCell::kNoLow ? 0 : d + 1e-14);
    ASSERT_GE(cell.high == TableCell::kNoHigh ? d : std::max<int>(cell.high, 0) * JointTable::kUnit, d - 1e-14);
  }
  EXPECT_GT(touching, 200);
  EXPECT_GT(apart, 200);
  EXPECT_GT(free, apart * 3 / 4);
}

TEST(JointTable, IsMadeForOneOrTwoJointsOnly) {
  const std::string ends = link("base", shapes(kPin)) + link("tip", shapes(kPin));
  EXPECT_FALSE(TwoLinks(ends + joint("j", "fixed", "base", "tip", "1 0 0", "1 0 0")).pair());
  EXPECT_FALSE(TwoLinks(ends + joint("j", "floating", "base", "tip", "1 0 0", "1 0 0")).pair());
  EXPECT_FALSE(TwoLinks(ends + joint("j", "planar", "base", "tip", "1 0 0", "0 0 1", limits(-1, 1))).pair());
  EXPECT_FALSE(TwoLinks(ends + link("a") + link("b") + joint("i", "continuous", "base", "a", "0 0 0", "0 0 1") +
                        joint("j", "continuous", "a", "b", "0 0 0", "0 1 0") +
                        joint("k", "continuous", "b", "tip", "0 0 0", "1 0 0"))
                   .pair());
  EXPECT_FALSE(
      TwoLinks(link("base", shapes(kPin)) + link("tip") + joint("j", "continuous", "base", "tip", "0 0 0", "1 0 0"))
          .pair());
}

TEST(JointTable, IsReadFromItsRecord) {
  const std::string ends = link("base", shapes(kPin)) + link("tip", shapes(kPin));
  const TwoLinks links(ends + joint("j", "revolute", "base", "tip", "0 0 0", "0 0 1", limits(-0.5, 0.5))),
      longer(ends + joint("j", "revolute", "base", "tip", "0 0 0", "0 0 1", limits(-0.5, 0.6))),
      turned(ends + joint("j", "revolute", "base", "tip", "0 0 0", "0 1 0", limits(-0.5, 0.5)));
  const JointTable table = *make_joint_table(*links.pair());
  std::vector<std::byte> record = joint_table_record(table);
  const std::optional<JointTable> read = joint_table_of_record(*links.pair(), record);
  ASSERT_TRUE(read);
  EXPECT_EQ(joint_table_record(*read), record);
  ASSERT_EQ(read->cells.size(), table.cells.size());
  EXPECT_EQ(read->cells.back().low, table.cells.back().low);
  EXPECT_EQ(read->columns[0].cells_per_unit, table.columns[0].cells_per_unit);
  EXPECT_NE(joint_table_name(*links.pair()), joint_table_name(*longer.pair()));
  EXPECT_NE(joint_table_name(*links.pair()), joint_table_name(*turned.pair()));
  const std::size_t cell = 4 * 2048;  // where `low` and `high` differ
  std::swap(record[cell], record[cell + 2]);
  std::swap(record[cell + 1], record[cell + 3]);
  EXPECT_FALSE(joint_table_of_record(*links.pair(), record));
  record.pop_back();
  EXPECT_FALSE(joint_table_of_record(*links.pair(), record));
}

}  // namespace
}  // namespace clearance::exact
