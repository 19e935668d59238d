// Replacement of a body's points, as a whole or not at all, and its effect on queries.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <thread>

#include "engine/engine.h"
#include "engine/narrow/answer.h"
#include "tests/engine/evaluate_query.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kCloud = 0, kBall = 1;

/// A cloud, at the origin unless it is live, and a ball of radius 0.5 at x = 10.
engine::Scene scene_of(std::span<const CloudPoint> points, double voxel = 0, bool requires_pose = false,
                       double radius = 0) {
  engine::Scene scene;
  engine::Scene::BodyOptions options;
  options.requires_pose = requires_pose;
  options.radius = radius;
  if (!requires_pose) options.pose = Pose{};
  scene.add_points("cloud", points, voxel, options);
  engine::Scene::BodyOptions there;
  there.pose = Pose{{10, 0, 0}};
  scene.add_sphere("ball", 0.5, there);
  return scene;
}

/// Answer about the two bodies.
PairAnswer look(const engine::Engine& engine) {
  const BodyPair pair{kCloud, kBall};
  QueryView query;
  query.pairs = std::span(&pair, 1);
  query.all_pairs = false;
  query.fields = kDefaultFields | kFieldFlags;
  const Answer a = evaluate(engine, query);
  PairAnswer answer = no_answer(static_cast<Status>(a.view.status[0]));
  answer.lower = a.view.lower[0];
  answer.upper = a.view.upper[0];
  return answer;
}

void expect_near(const PairAnswer& answer, double distance) {
  EXPECT_EQ(answer.status, Status::kOk);
  EXPECT_LE(answer.lower, distance);
  EXPECT_GE(answer.upper, distance);
  EXPECT_LT(answer.upper - answer.lower, 1e-5 * (1 + distance));
}

TEST(Points, ReplaceThoseBeforeThem) {
  engine::Engine engine(scene_of(std::vector<CloudPoint>{{0, 0, 0}, {1, 0, 0}}));
  const std::uint64_t revision = engine.scene_revision();
  expect_near(look(engine), 8.5);
  const std::vector<CloudPoint> next{{0, 0, 0}, {2, 0, 0}, {-1, 0, 0}};
  EXPECT_EQ(engine.set_points(kCloud, next).applied, 3u);
  expect_near(look(engine), 7.5);
  engine.set_points(kCloud, next, 0.25);
  expect_near(look(engine), 7.25);
  EXPECT_EQ(engine.scene_revision(), revision) << "ids and pairs are the same";
}

TEST(Points, OfVoxelsAreBoxes) {
  engine::Engine engine(scene_of(std::vector<CloudPoint>{{0, 0, 0}}, 0.5));
  expect_near(look(engine), 9.25);
  engine.set_points(kCloud, std::vector<CloudPoint>{{1, 0, 0}});
  expect_near(look(engine), 8.25);
}

TEST(Points, AreAwaitedWhereTheBodyIsLive) {
  engine::Engine engine(scene_of({}, 0, true));
  EXPECT_EQ(look(engine).status, Status::kNoPose);
  engine.set_poses(std::vector<BodyPose>{{kCloud, Pose{}}});
  EXPECT_EQ(look(engine).status, Status::kNoPose) << "there is a pose, but no points";
  engine.set_points(kCloud, std::vector<CloudPoint>{{3, 0, 0}});
  expect_near(look(engine), 6.5);
}

TEST(Points, MayBeNoneAndThenNothingIsNear) {
  engine::Engine engine(scene_of({}));
  EXPECT_EQ(look(engine).status, Status::kBeyond);
  EXPECT_EQ(look(engine).lower, kInf);
  engine.set_points(kCloud, std::vector<CloudPoint>{{3, 0, 0}});
  expect_near(look(engine), 6.5);
  engine.set_points(kCloud, {});
  EXPECT_EQ(look(engine).status, Status::kBeyond);
  QueryView least;
  least.fields = kDefaultFields;
  least.reduce = Reduce::kMin;
  EXPECT_EQ(evaluate(engine, least).view.lower[0], kInf);
  least.reduce = Reduce::kAny;
  EXPECT_EQ(static_cast<Status>(evaluate(engine, least).view.status[0]), Status::kBeyond);
}

TEST(Points, OfAnotherBodyAreRejectedAndSoIsWhatIsNotFinite) {
  engine::Engine engine(scene_of(std::vector<CloudPoint>{{0, 0, 0}}));
  const auto rejected = [&](std::uint32_t body, const std::vector<CloudPoint>& points, std::optional<double> radius,
                            const std::string& text) {
    try {
      engine.set_points(body, points, radius);
      ADD_FAILURE() << text;
    } catch (const engine::QueryError& e) {
      EXPECT_NE(std::string(e.what()).find(text), std::string::npos) << e.what();
    }
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  rejected(kBall, {{0, 0, 0}}, {}, "'ball' is not a point cloud");
  rejected(7, {{0, 0, 0}}, {}, "unknown body 7");
  rejected(kCloud, {{0, 0, 0}, {0, nan, 0}}, {}, "point 1 has the coordinate");
  rejected(kCloud, {{0, 2e9f, 0}}, {}, "up to 1e9 m");
  rejected(kCloud, {{0, 0, 0}}, -1, "radius must be");
  expect_near(look(engine), 9.5);
}

TEST(Points, OfAnOlderStampAreRejected) {
  engine::Engine engine(scene_of(std::vector<CloudPoint>{{0, 0, 0}}));
  engine.set_points(kCloud, std::vector<CloudPoint>{{1, 0, 0}}, {}, 1000, 1, 5);
  EXPECT_THROW(engine.set_points(kCloud, std::vector<CloudPoint>{{2, 0, 0}}, {}, 999, 2, 5), engine::QueryError);
  expect_near(look(engine), 8.5);
}

TEST(Points, GrowOlderAsPosesDo) {
  const BodyPair pair{kCloud, kBall};
  const std::uint32_t moved[] = {kCloud, kBall};
  const Pose at[] = {Pose{}, Pose{{10, 0, 0}}};
  for (const bool has_pose : {true, false}) {
    SCOPED_TRACE(has_pose);
    engine::Engine engine(scene_of({}, 0, true));
    if (has_pose) engine.set_poses(std::vector<BodyPose>{{kCloud, Pose{}}, {kBall, Pose{{10, 0, 0}}}});
    engine.set_points(kCloud, std::vector<CloudPoint>{{0, 0, 0}}, {}, 77, 3);
    QueryView query;
    query.pairs = std::span(&pair, 1);
    query.all_pairs = false;
    query.bodies = moved;
    query.configurations = at;
    query.configuration_count = 1;
    EXPECT_EQ(evaluate(engine, query).view.status[0], std::uint8_t(Status::kOk)) << "any age";
    query.max_pose_age_ns = 1;  // every received pose is older
    const Answer reply = evaluate(engine, query);
    EXPECT_EQ(reply.view.status[0], std::uint8_t(Status::kStalePose))
        << "the query says where the cloud is, but not what is there";
    EXPECT_EQ(reply.info.snapshot_stamp_ns, 77);
    EXPECT_EQ(reply.info.snapshot_sequence, 3);
    EXPECT_GT(reply.info.pose_age_ns, 0);
  }
}

TEST(Points, GoOverToAnotherEngine) {
  engine::Engine old(scene_of(std::vector<CloudPoint>{{0, 0, 0}}));
  old.set_points(kCloud, std::vector<CloudPoint>{{2, 0, 0}}, 0.5);
  engine::Engine engine(scene_of(std::vector<CloudPoint>{{0, 0, 0}}));
  engine.take_poses(old);
  expect_near(look(engine), 7);
}

// All points of a cloud have the same x, so that a query of a partly replaced cloud would fail.
TEST(Points, AreReplacedAllAtOnceWhileQueriesRun) {
  std::vector<CloudPoint> first(3000), second(3000);
  for (std::size_t i = 0; i < first.size(); ++i) {
    const float y = static_cast<float>(i % 50) - 25, z = static_cast<float>(i / 50) - 30;
    first[i] = {0, y, z};
    second[i] = {4, y, z};
  }
  engine::Engine engine(scene_of(first));
  std::atomic<bool> ends{false};
  std::thread writer([&] {
    for (int i = 0; i < 40; ++i) engine.set_points(kCloud, i % 2 ? first : second);
    ends = true;
  });
  int seen[2] = {0, 0};
  do {
    const PairAnswer answer = look(engine);
    ASSERT_EQ(answer.status, Status::kOk);
    const bool is_second = answer.upper < 7;
    ++seen[is_second];
    expect_near(answer, is_second ? 5.5 : 9.5);
  } while (!ends);
  writer.join();
  expect_near(look(engine), 9.5);
  EXPECT_GT(seen[0] + seen[1], 0);
}

TEST(Points, AgainstAHalfSpaceAreExact) {
  engine::Scene scene;
  engine::Scene::BodyOptions options;
  const double c = std::sqrt(0.5);
  options.pose = Pose{{0, 0, 5}, c, c, 0, 0};  // rotated about x: its y is the world's z
  scene.add_points("cloud", std::vector<CloudPoint>{{1, -2, 3}, {0, 4, 0}, {2, -3.5f, 9}}, 0, options);
  scene.add_half_space("floor", {});
  const engine::Engine engine(std::move(scene));
  expect_near(look(engine), 1.5);
}

TEST(Points, HaveNoDepth) {
  const engine::Engine engine(scene_of(std::vector<CloudPoint>{{0, 0, 0}}));
  QueryView query;
  query.signed_distance = true;
  EXPECT_THROW(engine.size(query), engine::QueryError);
}

}  // namespace
}  // namespace clearance::test
