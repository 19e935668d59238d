// Poses in queries: attachments, the snapshot at the start of a job, stamps and ages.
#include <algorithm>

#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

TEST_P(EngineTest, AttachedBodiesFollowAndLeaveThePairTable) {
  engine::Scene scene;
  scene.add_box("hand", {0.2, 0.2, 0.2}, {.pose = Pose{}});
  scene.add_box("cup", {0.1, 0.1, 0.1}, {.pose = Pose{{0.5, 0, 0}}});
  scene.add_box("wall", {1, 1, 1}, {.is_static = true, .pose = Pose{{5, 0, 0}}});
  engine::Engine engine = make(std::move(scene));
  const std::uint64_t free_revision = engine.scene_revision();
  EXPECT_EQ(engine.pairs({}).size(), 3u);
  engine.attach(1, 0);
  EXPECT_NE(engine.scene_revision(), free_revision);
  EXPECT_EQ(engine.pairs({}).size(), 2u);
  const BodyPose update{0, {{0, 1, 0}}};
  engine.set_poses({&update, 1});
  EXPECT_NEAR(engine.body_state(1).X_wb.translation.x, 0.5, 1e-15);
  EXPECT_NEAR(engine.body_state(1).X_wb.translation.y, 1.0, 1e-15);
  EXPECT_THROW(engine.attach(0, 1), engine::QueryError) << "a cycle";
  EXPECT_THROW(engine.attach(2, 0), engine::QueryError) << "a static child";
  engine.attach(1, kNone);
  EXPECT_EQ(engine.scene_revision(), free_revision);
  EXPECT_NEAR(engine.body_state(1).X_wb.translation.y, 1.0, 1e-15);
}

TEST_P(EngineTest, JobsKeepTheSnapshotTheyBeganWith) {
  engine::Scene scene;
  scene.add_sphere("a", 0.5, {.pose = Pose{}});
  scene.add_sphere("b", 0.5, {.pose = Pose{{3, 0, 0}}});
  engine::Engine engine = make(std::move(scene));
  double distance = 0;
  ReplyView reply;
  reply.distance = &distance;
  QueryView q;
  q.fields = kFieldDistance;
  Job job = engine.start(q, reply);
  const BodyPose update{1, {{100, 0, 0}}};
  const std::uint64_t revision = engine.set_poses({&update, 1}, 42).revision;
  while (!job.advance()) {
  }
  EXPECT_NEAR(distance, 2, 1e-12);
  EXPECT_LT(job.info().snapshot_revision, revision);
  EXPECT_EQ(evaluate(engine, q).info.snapshot_stamp_ns, 42);
}

TEST_P(EngineTest, StalePosesAreNoneWhereTheQueryLimitsTheirAge) {
  engine::Scene scene;
  scene.add_sphere("a", 0.5, {.pose = Pose{}});
  scene.add_sphere("hand", 0.5, {.parent = "a", .pose = Pose{{0, 2, 0}}});
  scene.add_sphere("wall", 0.5, {.is_static = true, .pose = Pose{{3, 0, 0}}});
  scene.add_sphere("floor", 0.5, {.is_static = true, .pose = Pose{{3, 0, 9}}});
  engine::Engine engine = make(std::move(scene));
  const std::vector<BodyPair> pairs{{0, 2}, {1, 2}, {2, 3}};
  QueryView q;
  q.pairs = pairs;
  q.all_pairs = false;
  q.fields = kAllFields;
  EXPECT_NEAR(evaluate(engine, q).view.distance[0], 2, 1e-9) << "any age";
  q.max_pose_age_ns = 3'600'000'000'000;
  const auto expect_stale = [&] {
    const Answer answer = evaluate(engine, q);
    for (int row = 0; row < 2; ++row) {
      EXPECT_EQ(static_cast<Status>(answer.view.status[row]), Status::kStalePose);
      EXPECT_TRUE(std::isnan(answer.view.distance[row]));
      EXPECT_EQ(answer.view.lower[row], -kInf);
      EXPECT_EQ(answer.view.upper[row], kInf);
    }
    EXPECT_EQ(static_cast<Status>(answer.view.status[2]), Status::kOk) << "what never moves is never stale";
    EXPECT_NEAR(answer.view.distance[2], 8, 1e-9);
  };
  expect_stale();
  const BodyPose update{0, {}};
  engine.set_poses({&update, 1});
  EXPECT_NEAR(evaluate(engine, q).view.distance[0], 2, 1e-9);
  q.max_pose_age_ns = 1;
  expect_stale();

  q.reduce = Reduce::kMin;
  const Answer least = evaluate(engine, q);
  EXPECT_EQ(static_cast<Status>(least.view.status[0]), Status::kStalePose);
  EXPECT_EQ(least.view.lower[0], -kInf);
  EXPECT_TRUE(least.view.flags[0] & kFlagIncomplete);

  q.reduce = Reduce::kNone;
  const std::uint32_t moved = 0;
  const Pose there{{0, 0, 1}};
  q.bodies = {&moved, 1};
  q.configurations = {&there, 1};
  q.configuration_count = 1;
  EXPECT_EQ(static_cast<Status>(evaluate(engine, q).view.status[0]), Status::kOk) << "the query says where it is";
}

TEST_P(EngineTest, ALiveBodyHasNoPoseUntilOneIsReceived) {
  engine::Scene scene;
  scene.add_sphere("tool", 0.5, {.pose = Pose{}, .requires_pose = true});
  scene.add_sphere("cup", 0.5, {.parent = "tool", .pose = Pose{{0, 2, 0}}});
  scene.add_sphere("wall", 0.5, {.is_static = true, .pose = Pose{{3, 0, 0}}});
  EXPECT_THROW(scene.add_sphere("rock", 0.5, {.is_static = true, .requires_pose = true}), engine::SceneError);
  engine::Engine engine = make(std::move(scene));
  const std::vector<BodyPair> pairs{{0, 2}, {1, 2}};
  QueryView q;
  q.pairs = pairs;
  q.all_pairs = false;
  for (int row = 0; row < 2; ++row)
    EXPECT_EQ(static_cast<Status>(evaluate(engine, q).view.status[row]), Status::kNoPose) << row;
  EXPECT_EQ(engine.body_state(0).status, Status::kNoPose);
  EXPECT_THROW(engine.attach(1, kNone), engine::QueryError) << "from nowhere";
  const BodyPose update{0, {}};
  engine.set_poses({&update, 1});
  EXPECT_NEAR(evaluate(engine, q).view.distance[0], 2, 1e-9);
  EXPECT_EQ(static_cast<Status>(evaluate(engine, q).view.status[1]), Status::kOk);
}

TEST_P(EngineTest, TheAgeOfPosesIsWhatStaleGoesBy) {
  engine::Scene scene;
  for (const char* name : {"a", "b", "c"}) scene.add_sphere(name, 0.1, {.pose = Pose{}});
  engine::Engine engine = make(std::move(scene));
  QueryView q;
  const std::vector<BodyPair> pairs{{0, 1}, {1, 2}};
  q.pairs = pairs;
  q.all_pairs = false;
  EXPECT_EQ(evaluate(engine, q).info.pose_age_ns, -1) << "none was received";
  for (std::uint32_t body = 0; body < 3; ++body) {
    const BodyPose update{body, {{1.0 * body, 0, 0}}};
    engine.set_poses({&update, 1}, 10 * body, body + 1);
  }
  int stale = 0, young = 0;
  for (int i = 0; i < 400; ++i) {
    const Answer plain = evaluate(engine, q);
    EXPECT_EQ(plain.info.snapshot_sequence, 3);
    EXPECT_GE(plain.info.pose_age_ns, 0);
    QueryView limited = q;
    const std::int64_t off = std::int64_t{1} << i % 40;  // from less than the elapsed time to far more
    limited.max_pose_age_ns = std::max<std::int64_t>(plain.info.pose_age_ns + (i % 2 ? off : -off), 1);
    const Answer answer = evaluate(engine, limited);
    const bool too_old = answer.info.pose_age_ns > limited.max_pose_age_ns;
    const auto is_stale = [&](int row) { return static_cast<Status>(answer.view.status[row]) == Status::kStalePose; };
    EXPECT_EQ(is_stale(0), too_old) << "body 0 has the oldest pose";
    if (!too_old) {
      EXPECT_FALSE(is_stale(1));
    }
    ++(too_old ? stale : young);
  }
  EXPECT_GT(stale, 0);
  EXPECT_GT(young, 0);
}

}  // namespace
}  // namespace clearance::test
