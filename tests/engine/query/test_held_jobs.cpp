// A job that is held answers as a new one would, and never for an old snapshot (also test_job_pool.cpp).
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <map>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "tests/engine/query/repeated_jobs.h"

namespace clearance::test {
namespace {

// A held job answers no query that does not fit it, and waits on for the next one.
TEST(HeldJobs, TakeOnlyConfigurationsThatFit) {
  const Arm arm(4);
  const engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1});
  const QueryView q = arm.query(1);
  Held held;
  const Answer wanted = held.answer(engine, q);
  ASSERT_TRUE(held.job);
  QueryView few = q, two = q;
  few.positions = few.positions.first(1);
  Answer room = empty_answer(engine, q);
  EXPECT_THROW(engine.answer_again(*held.job, few, room.view), engine::QueryError);
  two.configuration_count = 2;
  two.positions = std::span(arm.positions).first(2 * arm.joints.size());
  EXPECT_FALSE(engine.answer_again(*held.job, two, room.view));
  expect_same(held.answer(engine, q), wanted);
  EXPECT_EQ(held.again, 1u);
  const Answer both = held.answer(engine, two);  // returns the first job to the pool
  EXPECT_EQ(both.info.rows, 2 * wanted.info.rows);
  EXPECT_TRUE(engine.has_job(q, held.pool));
  EXPECT_FALSE(engine.has_job(two, held.pool));
}

// The snapshot of the last answer is not the present one, though another query still holds it.
TEST(HeldJobs, AnswerForNoOldSnapshotThatAnotherQueryHolds) {
  const Arm arm(1);
  engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  const QueryView q = arm.query();
  Held held;
  const Answer first = held.answer(engine, q);
  ASSERT_TRUE(held.job);
  const PreparedQuery holds = engine.prepare(q);
  const BodyPose moved{arm.scene.find_body("ball"), Pose{{0.3, 0.1, 0.4}}};
  engine.set_poses({&moved, 1});
  const Answer second = held.answer(engine, q);
  EXPECT_EQ(held.again, 0u);
  EXPECT_LT(first.info.snapshot_revision, second.info.snapshot_revision);
  EXPECT_EQ(second.info.snapshot_revision, engine.pose_revision());
  expect_same(second, evaluate(engine, q));
}

// Each answer is of poses as they are during its call, and never of earlier ones than the answer before.
TEST(HeldJobs, OfThreadsFollowThePoses) {
  constexpr int kThreads = 3, kPoses = 200;
  const Arm arm(1);
  engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  const std::uint32_t ball = arm.scene.find_body("ball"), rock = arm.scene.find_body("rock");
  const BodyPair pair{ball, rock};
  QueryView q = arm.query();
  q.fields = kFieldDistance;
  q.all_pairs = false;
  q.pairs = {&pair, 1};
  // Spheres: the distance is known for each revision.
  std::map<std::uint64_t, double> wanted;
  const auto pose = [](int i) { return Pose{{1 + 0.01 * i, -0.3, 0.4}}; };
  const auto set = [&](int i) {
    const BodyPose moved{ball, pose(i)};
    engine.set_poses({&moved, 1});
    wanted[engine.pose_revision()] = evaluate(engine, q).view.distance[0];
  };
  set(0);
  std::atomic<bool> is_done{false};
  std::array<std::vector<std::pair<std::uint64_t, double>>, kThreads> found;
  std::vector<std::thread> threads;
  for (auto& answers : found)
    threads.emplace_back([&] {
      Held held;
      for (bool last = false; !last;) {
        last = is_done;
        const Answer answer = held.answer(engine, q);
        answers.emplace_back(answer.info.snapshot_revision, answer.view.distance[0]);
      }
    });
  for (int i = 1; i < kPoses; ++i) set(i);
  is_done = true;
  for (std::thread& thread : threads) thread.join();
  for (const auto& answers : found) {
    EXPECT_EQ(answers.back().first, engine.pose_revision());
    std::uint64_t before = 0;
    for (const auto& [revision, distance] : answers) {
      EXPECT_GE(revision, before);
      EXPECT_EQ(distance, wanted.at(revision));
      before = revision;
    }
  }
}

}  // namespace
}  // namespace clearance::test
