// Planes that separate two links, and points that both hold: their bounds hold throughout a block of positions.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "engine/joint_table/block_planes.h"
#include "engine/narrow/narrow_phase.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/oracle/decision/two_links.h"

namespace clearance::exact {
namespace {

std::string collision(const std::string& origin, const std::string& shape) {
  return "<collision><origin xyz='" + origin + "'/><geometry><" + shape + "/></geometry></collision>";
}

/// The links at some positions.
class PlacedLinks {
 public:
  explicit PlacedLinks(const TwoLinks& links)
      : pair_(*links.pair()), robot_(pair_.robot->kinematics), poses_(robot_.links()) {}

  void place(const Positions& at) {
    std::vector<double> q(robot_.columns(), 0);
    for (std::size_t c = 0; c < pair_.columns.size(); ++c) q[pair_.columns[c]] = at[c];
    std::vector<Status> status(1);
    robot_.place(q, std::vector<Pose>(robot_.roots().size()), poses_, status);
  }
  const std::vector<Pose>& poses() const { return poses_; }
  PoseMatrix a() const { return matrix(pair_.a.link); }
  PoseMatrix b() const { return matrix(pair_.b.link); }
  NarrowAnswer nearest() const {
    return narrow_phase(*pair_.a.parts[0], a(), *pair_.b.parts[0], b(), {.signed_distance = true});
  }

 private:
  PoseMatrix matrix(std::uint32_t link) const {
    const Pose& X = poses_[link];
    return {rotation_of(X), X.translation, X};
  }

  const TablePair& pair_;
  const Kinematics& robot_;
  std::vector<Pose> poses_;
};

/// Counts blocks with a positive bound, and those whose least distance it nearly reaches.
struct Blocks {
  int positive = 0, tight = 0;
};

// The least distance in a block is at most that of its corners, middle and some other positions.
Blocks check_blocks(const TwoLinks& links, double travel, int count) {
  test::RobotRandom random(7);
  const TablePair& pair = *links.pair();
  PlacedLinks placed(links);
  BlockPlanes planes(pair, travel);
  Blocks blocks;
  for (int n = 0; n < count; ++n) {
    const Positions middle{random.uniform(-0.8, 0.8), random.uniform(-0.8, 0.8)};
    const Positions half{random.uniform(0.01, 0.2), random.uniform(0.01, 0.2)};
    planes.take_size(std::span(half).first(pair.columns.size()));
    placed.place(middle);
    planes.take_middle(placed.poses());
    const NarrowAnswer nearest = placed.nearest();
    if (!(nearest.bounds.lower > 0)) continue;
    const double gap = planes.gap(*pair.a.parts[0], placed.a(), *pair.b.parts[0], placed.b(), nearest.normal);
    if (!(gap > 0)) continue;
    double least = nearest.bounds.upper;
    for (int k = 0; k < 20; ++k) {
      Positions at = middle;
      for (std::size_t c = 0; c < 2; ++c) {
        const double side = (k >> c & 1) != 0 ? 1 : -1;
        at[c] += half[c] * (k < 4 ? side : random.uniform(-1, 1));
      }
      placed.place(at);
      least = std::min(least, placed.nearest().bounds.upper);
    }
    EXPECT_LE(gap, least + 1e-14);
    ++blocks.positive;
    blocks.tight += gap > 0.9 * least;
  }
  std::printf("%d positive, %d tight\n", blocks.positive, blocks.tight);
  return blocks;
}

// Depths in a block are at least the radius of the ball that both links are found to hold.
// \param far, wide limits of the middles and halves of blocks
int check_overlaps(const TwoLinks& links, int count, double far, double wide) {
  test::RobotRandom random(9);
  const TablePair& pair = *links.pair();
  PlacedLinks placed(links);
  BlockPlanes planes(pair, 1);
  int held = 0, overlapping = 0;
  for (int n = 0; n < count; ++n) {
    const Positions middle{random.uniform(-far, far), random.uniform(-far, far)};
    const Positions half{random.uniform(0.001, wide), random.uniform(0.001, wide)};
    planes.take_size(std::span(half).first(pair.columns.size()));
    placed.place(middle);
    planes.take_middle(placed.poses());
    const NarrowAnswer nearest = placed.nearest();
    if (!(nearest.bounds.upper < 0)) continue;
    ++overlapping;
    const PoseMatrix a = placed.a(), b = placed.b();
    const double radius = planes.shared(0, a, 0, b, (a.t_w + nearest.point_a + b.t_w + nearest.point_b) * 0.5);
    if (!(radius > 0)) continue;
    ++held;
    for (int k = 0; k < 20; ++k) {
      Positions at = middle;
      for (std::size_t c = 0; c < 2; ++c)
        at[c] += half[c] * (k >= 4 ? random.uniform(-1, 1) : (k >> c & 1) != 0 ? 1 : -1);
      placed.place(at);
      EXPECT_LE(placed.nearest().bounds.lower, -radius + 1e-14);
    }
  }
  std::printf("%d of %d held\n", held, overlapping);
  return held;
}

const std::string kWall = collision("-1.5 0 0", "box size='2 8 8'"),
                  kBall = collision("0 0 0.3", "sphere radius='0.02'");
const std::string kRod = collision("0 0 0.2", "cylinder radius='0.02' length='0.3'"),
                  kBar = collision("0.1 0 0.2", "box size='0.04 0.3 0.06'");

// Far from the wall, velocities are along it, and acceleration alone brings the tip nearer.
TEST(BlockPlanes, HoldWhereLinksTurnAndBend) {
  for (const std::string& tip : {kBall, kRod, kBar}) {
    const TwoLinks links(link("base", kWall) + link("mid") + link("tip", tip) +
                         joint("j", "revolute", "base", "mid", "0.2 0 0", "0 1 0", limits(-3, 3)) +
                         joint("k", "revolute", "mid", "tip", "0.3 0 0.1", "0 1 0", limits(-3, 3)));
    ASSERT_TRUE(links.pair());
    const Blocks blocks = check_blocks(links, 0, 1000);
    EXPECT_GT(blocks.positive, 500);
    EXPECT_GT(blocks.tight, 100);
  }
}

// The joints are on both sides of the links' common frame.
TEST(BlockPlanes, HoldWhereBothLinksMove) {
  const TwoLinks links(link("root") + link("base", kBar) + link("tip", kRod) +
                       joint("j", "revolute", "root", "base", "0 0 0", "0 0 1", limits(-3, 3)) +
                       joint("k", "revolute", "root", "tip", "0.4 0.1 0", "0.6 0 0.8", limits(-3, 3)));
  ASSERT_TRUE(links.pair());
  const Blocks blocks = check_blocks(links, 0, 1000);
  EXPECT_GT(blocks.positive, 300);
  EXPECT_GT(blocks.tight, 50);
}

TEST(BlockPlanes, HoldForOneJointAndASlide) {
  const TwoLinks one(link("base", kWall) + link("tip", kBar) +
                     joint("j", "revolute", "base", "tip", "0.2 0 0", "0 0.8 0.6", limits(-3, 3))),
      slide(link("base", kBar) + link("mid") + link("tip", kRod) +
            joint("j", "revolute", "base", "mid", "0.3 0 0.1", "0 0 1", limits(-3, 3)) +
            joint("k", "prismatic", "mid", "tip", "0.1 0 0", "0.6 0.8 0", limits(-1, 1)));
  ASSERT_TRUE(one.pair() && slide.pair());
  EXPECT_GT(check_blocks(one, 0, 500).tight, 100);
  EXPECT_GT(check_blocks(slide, 1, 1000).tight, 50);
}

// Boxes that graze each other: the depth is often little more than their movement.
TEST(BlockPlanes, SharedPointsStayInBothLinks) {
  const std::string flat = collision("0 0 -0.05", "box size='0.6 0.6 0.1'");
  const TwoLinks slide(link("base", flat) + link("mid") + link("tip", collision("0 0 0.1", "box size='0.3 0.1 0.2'")) +
                       joint("j", "revolute", "base", "mid", "0 0 -0.003", "0.1 0 1", limits(-3, 3)) +
                       joint("k", "prismatic", "mid", "tip", "0 0 0", "0.9 0.1 0.01", limits(-1, 1))),
      both(link("root") + link("base", flat) + link("tip", collision("0 0 0.1", "box size='0.05 0.3 0.2'")) +
           joint("j", "revolute", "root", "base", "0 0 0", "0 1 0.2", limits(-3, 3)) +
           joint("k", "revolute", "root", "tip", "0.2 0.1 0", "0.6 0 0.8", limits(-3, 3)));
  ASSERT_TRUE(slide.pair() && both.pair());
  EXPECT_GT(check_overlaps(slide, 600, 0.8, 0.03), 100);
  EXPECT_GT(check_overlaps(both, 600, 0.8, 0.03), 50);
}

// The tip dips into the wall, along which it moves: acceleration alone takes it out.
TEST(BlockPlanes, SharedPointsStayInTipsThatTurnAway) {
  for (const char* const depth : {"-0.2901", "-0.2902", "-0.2905"}) {  // the tip's centre, 0.1 mm to 0.5 mm too far
    const TwoLinks links(link("base", collision("-1 0 0", "box size='2 8 8'")) +
                         link("tip", collision(depth + std::string(" 0 0"), "box size='0.02 0.002 0.002'")) +
                         joint("j", "revolute", "base", "tip", "0.3 0 0", "0 0 1", limits(-3, 3)));
    ASSERT_TRUE(links.pair());
    EXPECT_GT(check_overlaps(links, 300, 0.01, 0.08), 20);
  }
}

}  // namespace
}  // namespace clearance::exact
