// explain_path() of paths along which bodies move, turn and grow.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "engine/api/engine.h"
#include "planner/path_report.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

Pose7 at(double x, double y, double qw = 1, double qz = 0) {
  return {x, y, 0, qw, 0, 0, qz};
}

/// A cart, a ball of 0.1 m on a rail along x; a ball of the same size, a bar of 1 m along x, and a cloud of two points
/// of 0.05 m.
struct Rail {
  TemporaryFolder folder;
  Engine engine{scene(folder), {.backend = "cpu", .threads = 1}};
  std::vector<std::uint32_t> joints = engine.joints("r").ids;
  std::uint32_t ball = engine.body("ball"), bar = engine.body("bar"), cloud = engine.body("cloud"),
                cart = engine.body("r/cart");

  static Scene scene(const TemporaryFolder& folder) {
    Scene scene;
    scene.add_robot(
        "r", {.urdf = folder.write(
                  "rail.urdf",
                  "<robot name='r'><link name='base'/><link name='cart'><collision><geometry><sphere radius='0.1'/>"
                  "</geometry></collision></link><joint name='x' type='prismatic'><parent link='base'/>"
                  "<child link='cart'/><axis xyz='1 0 0'/><limit lower='-4' upper='4'/></joint></robot>"),
              .home = std::map<std::string, double>{}});
    scene.add_sphere("ball", 0.1, {.X_parent_body = at(0, 9)});
    scene.add_box("bar", {1, 0.1, 0.1}, {.X_parent_body = at(0, -9)});
    const std::vector<std::array<float, 3>> points{{0, 0, 0}, {0.01f, 0, 0}};
    scene.add_points("cloud", points, 0, {.radius = 0.05, .X_parent_body = at(9, 9)});
    return scene;
  }
  PathReport explain(Query query, std::uint32_t body) {
    const IdPair pair{cart, body};
    query.joints = joints;
    query.bodies = {&body, 1};
    query.pairs = {&pair, 1};
    return explain_path(engine, query);
  }
};

TEST(MovingReports, AFreePathHasItsLeastDistanceWithGrowth) {
  Rail rail;
  const std::vector<double> path{0, 2}, growths{0.05, 0.15}, none;
  const std::vector<Pose7> crossing{at(1, 1.5), at(1, -0.5)};
  for (const bool grows : {false, true}) {
    const PathReport report =
        rail.explain({.configurations = crossing, .positions = path, .growths = grows ? growths : none}, rail.ball);
    ASSERT_TRUE(report.check.free);
    double least = kInf, when = 0;
    for (int k = 0; k <= 2000; ++k) {
      const double t = k / 2000.0, d = std::hypot(2 * t - 1, 1.5 - 2 * t) - 0.2 - (grows ? 0.05 + 0.1 * t : 0);
      if (d < least) least = d, when = t;
    }
    EXPECT_LE(report.least->lower, least);
    EXPECT_LE(least, report.least->upper + 1e-6);
    EXPECT_LE(report.least->upper - report.least->lower, 1.001e-3);
    EXPECT_NEAR(report.nearest.t, when, 0.05);
    EXPECT_FALSE(report.contact);
  }
}

TEST(MovingReports, GrowthAloneHits) {
  Rail rail;
  // The cart leaves x = 0 at 2 m in the motion; the ball 1 m behind it grows by 3 m, so both touch at 0.8.
  for (const std::uint32_t points : {2u, 3u}) {
    std::vector<double> path{0, 2}, growths{0, 3};
    std::vector<Pose7> poses{at(-1, 0), at(-1, 0)};
    if (points == 3) {
      path.insert(path.begin() + 1, 1);
      growths.insert(growths.begin() + 1, 1.5);
      poses.push_back(at(-1, 0));
    }
    const Query query{
        .configurations = poses, .positions = path, .margin = 0.01, .control_points = points, .growths = growths};
    const PathReport report = rail.explain(query, rail.ball);
    ASSERT_TRUE(report.check.hit());
    ASSERT_TRUE(report.contact && report.proved_until);
    EXPECT_NEAR(report.proved_until->second, 0.79, 2e-3);
    EXPECT_LE(report.proved_until->second, report.contact->t);
    EXPECT_NEAR(report.contact->t, 0.79, 2e-3);
    EXPECT_LE(report.contact->upper, 0.01 + 1e-9);
    EXPECT_LE(report.contact->lower, report.contact->upper);
    EXPECT_EQ(report.nearest.t, 1);
    EXPECT_NEAR(report.nearest.upper, -0.2, 1e-9);
    EXPECT_EQ(report.nearest.lower, -kInf);
    EXPECT_NEAR(report.nearest.b[0], -0.9, 1e-9) << "a witness point of the ball without growth";
    EXPECT_EQ(report.contact->pair, (IdPair{rail.cart, rail.ball}));
  }
}

TEST(MovingReports, ABodyThatIsNearFromTheStart) {
  Rail rail;
  const std::vector<double> path{0, 0.5}, growths{0.4, 0.4};
  const std::vector<Pose7> poses{at(0.5, 0), at(0.5, 0)};
  const PathReport report = rail.explain({.configurations = poses, .positions = path, .growths = growths}, rail.ball);
  ASSERT_TRUE(report.contact);
  EXPECT_EQ(report.contact->t, 0);
  EXPECT_NEAR(report.contact->upper, -0.1, 1e-9);
  EXPECT_NEAR(report.nearest.upper, -0.6, 1e-9) << "0.2 m without growth, at the end";
  EXPECT_GT(report.nearest.lower, -0.6 - 1e-6) << "bodies that overlap without growth have a depth";
}

TEST(MovingReports, ABodyThatTurns) {
  Rail rail;
  // The bar stands across the rail at x = 1.2 at first and turns in place: its end reaches the cart, at x = 0.6, by half.
  const double half = std::sqrt(0.5);
  const std::vector<double> path{0.6, 0.6};
  const std::vector<Pose7> poses{at(1.2, 0, half, half), at(1.2, 0, -1, 0)};
  const PathReport report = rail.explain({.configurations = poses, .positions = path}, rail.bar);
  ASSERT_TRUE(report.contact);
  // At the angle a of the bar to the rail the ball of 0.1 m is past its end face, whose middle is at 0.5 cos a.
  const double angle = (1 - report.contact->t) * std::acos(-1.0) / 2;
  const double ahead = std::max(0.6 * std::cos(angle) - 0.5, 0.0), across = std::max(0.6 * std::sin(angle) - 0.05, 0.0);
  EXPECT_NEAR(std::hypot(ahead, across), 0.1, 5e-3);
  EXPECT_GT(across, 0.01);
  const PathReport free = rail.explain({.configurations = poses, .positions = std::vector<double>{0.4, 0.4}}, rail.bar);
  ASSERT_TRUE(free.check.free);
  EXPECT_NEAR(free.least->upper, 0.8 - std::hypot(0.5, 0.05) - 0.1, 1e-3) << "of a corner";
}

TEST(MovingReports, OneBodyOfManyGrows) {
  Rail rail;
  const std::vector<std::uint32_t> bodies{rail.bar, rail.ball};
  const std::vector<IdPair> pairs{{rail.cart, rail.bar}, {rail.cart, rail.ball}};
  const std::vector<double> path{0, 1}, growths{0, 0, 0, 1.4};
  const std::vector<Pose7> poses{at(0.5, 0.5), at(0.5, -1.5), at(0.5, 0.5), at(0.5, -1.5)};
  const PathReport report = explain_path(rail.engine, {.pairs = pairs,
                                                       .bodies = bodies,
                                                       .configurations = poses,
                                                       .joints = rail.joints,
                                                       .positions = path,
                                                       .growths = growths});
  ASSERT_TRUE(report.contact);
  EXPECT_EQ(report.contact->pair, pairs[1]) << "the bar is nearer, but does not grow";
  EXPECT_EQ(report.nearest.pair, pairs[1]);
  EXPECT_NEAR(report.nearest.upper, std::hypot(0.5, 1.5) - 0.2 - 1.4, 1e-9);
}

TEST(MovingReports, ACloudHasDistancesAndNoDepth) {
  Rail rail;
  const std::vector<Pose7> stays{at(1, 0), at(1, 0)};
  const auto along = [&](double end) {
    const std::vector<double> path{0, end};
    return rail.explain({.configurations = stays, .positions = path, .margin = 0.01}, rail.cloud);
  };
  const PathReport free = along(0.8), hit = along(2);
  ASSERT_TRUE(free.check.free);
  EXPECT_LE(free.least->lower, 0.05 + 1e-9);
  EXPECT_GE(free.least->upper, 0.05 - 1e-9);
  EXPECT_LE(free.least->upper - free.least->lower, 1.001e-3);
  EXPECT_EQ(free.nearest.pair, (IdPair{rail.cart, rail.cloud}));
  ASSERT_TRUE(hit.contact && hit.proved_until);
  EXPECT_NEAR(hit.contact->t, 0.42, 2e-3);
  EXPECT_EQ(hit.contact->pair, (IdPair{rail.cart, rail.cloud}));
  EXPECT_LE(hit.contact->lower, 0.85 - 2 * hit.contact->t + 1e-9);
  EXPECT_GE(hit.contact->upper, 0.85 - 2 * hit.contact->t - 1e-9);
  EXPECT_LE(hit.contact->upper, 0.01 + 1e-9);
  EXPECT_EQ(hit.nearest.pair, (IdPair{rail.cart, rail.cloud}));
  EXPECT_EQ(hit.nearest.lower, 0);
  EXPECT_EQ(hit.nearest.upper, 0);
}

TEST(MovingReports, ADepthIsNearerThanAnOverlapWithACloud) {
  Rail rail;
  const std::vector<std::uint32_t> bodies{rail.cloud, rail.ball};
  const std::vector<IdPair> pairs{{rail.cart, rail.cloud}, {rail.cart, rail.ball}};
  const std::vector<double> path{0, 1.2};
  const std::vector<Pose7> poses{at(1, 0), at(1.3, 0), at(1, 0), at(1.3, 0)};
  const PathReport report = explain_path(
      rail.engine,
      {.pairs = pairs, .bodies = bodies, .configurations = poses, .joints = rail.joints, .positions = path});
  ASSERT_TRUE(report.contact);
  EXPECT_EQ(report.contact->pair, pairs[0]);
  EXPECT_NEAR(report.contact->t, 0.85 / 1.2, 2e-3);
  EXPECT_EQ(report.nearest.pair, pairs[1]);
  EXPECT_NEAR(report.nearest.upper, -0.1, 1e-9);
}

TEST(MovingReports, ACloudThatGrows) {
  Rail rail;
  const std::vector<double> path{0, 0}, growths{0, 2};
  const std::vector<Pose7> stays{at(1, 0), at(1, 0)};
  const PathReport report = rail.explain({.configurations = stays, .positions = path, .growths = growths}, rail.cloud);
  ASSERT_TRUE(report.contact);
  EXPECT_NEAR(report.contact->t, 0.425, 2e-3);
  EXPECT_NEAR(report.nearest.upper, 0.85 - 2, 1e-6);
  EXPECT_EQ(report.nearest.lower, -kInf);
}

TEST(MovingReports, RejectsPathsWithoutJointsAndBadGrowths) {
  Rail rail;
  EXPECT_THROW(explain_path(rail.engine, {}), std::invalid_argument);
  const std::vector<double> path{0, 1}, one{0.1}, negative{0, -1};
  const std::vector<Pose7> poses{at(1, 1), at(1, 1)};
  EXPECT_THROW(rail.explain({.configurations = poses, .positions = path, .growths = one}, rail.ball),
               std::invalid_argument);
  EXPECT_THROW(rail.explain({.configurations = poses, .positions = path, .growths = negative}, rail.ball), QueryError);
}

}  // namespace
}  // namespace clearance
