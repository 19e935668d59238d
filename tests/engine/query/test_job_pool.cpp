// A prepared query reuses the job that answered it before: with the bits of a new one, and never for an old snapshot.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/engine/query/repeated_jobs.h"

namespace clearance::test {
namespace {

struct Named {
  std::string name;
  std::function<void(QueryView&)> set;
};

const std::vector<MarginEntry> kMargins{{kEveryBody, kEveryBody, 0.1}, {0, kEveryBody, 0.4}};

std::vector<Named> reductions() {
  return {{"none", [](QueryView&) {}},
          {"none, near", [](QueryView& q) { q.max_distance = 0.3; }},
          {"none, float32 columns", [](QueryView& q) { q.fields = kFloat32 | kFieldStatus; }},
          {"within",
           [](QueryView& q) {
             q.reduce = Reduce::kWithin;
             q.max_distance = 0.4;
           }},
          {"nearest", [](QueryView& q) { q.reduce = Reduce::kNearest; }},
          {"min", [](QueryView& q) { q.reduce = Reduce::kMin; }},
          {"min, signed",
           [](QueryView& q) {
             q.reduce = Reduce::kMin;
             q.signed_distance = true;
           }},
          {"any", [](QueryView& q) { q.reduce = Reduce::kAny; }},
          {"any, margins", [](QueryView& q) {
             q.reduce = Reduce::kAny;
             q.margin = 0.05;
             q.margins = kMargins;
           }}};
}

/// Runs each query in turn for configuration after configuration. Returns the number of rows by status.
/// \param query returns the query for a configuration number
std::array<std::uint64_t, 8> expect_bits_of_new_jobs(const engine::Scene& scene, int count,
                                                     const std::function<QueryView(int)>& query) {
  std::array<std::uint64_t, 8> seen{};
  const engine::Engine kept(scene, {.backend = "cpu", .threads = 2});
  for (const Precision precision : {Precision::kF64, Precision::kF32})
    for (const Named& reduction : reductions()) {
      SCOPED_TRACE(reduction.name + (precision == Precision::kF32 ? ", f32" : ""));
      const std::uint64_t before = jobs_reused(kept);
      const auto pool = std::make_shared<JobPool>();
      Held held;
      for (int k = 0; k < count; ++k) {
        QueryView q = query(k);
        q.precision = precision;
        reduction.set(q);
        const Answer answer = repeat(kept, q, pool);
        expect_same(answer, repeat(kept, q, std::make_shared<JobPool>()));
        expect_same(held.answer(kept, q), answer);
        if (::testing::Test::HasFatalFailure()) return seen;
        for (std::uint64_t i = 0; i < answer.info.rows; ++i) ++seen[answer.view.status[i]];
      }
      EXPECT_EQ(held.again, static_cast<std::uint64_t>(count - 1));
      EXPECT_EQ(jobs_reused(kept) - before, 2 * held.again);
    }
  return seen;
}

TEST(JobPool, PosesAreAnsweredWithTheBitsOfNewJobs) {
  const std::vector<std::uint32_t> bodies{0, 3, 7, 13};
  Random random(1);
  std::vector<Pose> poses;
  for (int i = 0; i < 12 * 4; ++i) poses.push_back(random.pose(1.5));
  const auto query = [&](int k, std::uint32_t configurations) {
    QueryView q;
    q.fields = kAllFields | kFieldPairLower;
    q.bodies = bodies;
    q.configuration_count = configurations;
    q.configurations = std::span(poses).subspan(static_cast<std::size_t>(k) * 4, configurations * 4);
    return q;
  };
  const engine::Scene scene = decomposed_scene(30, 1.5, 7);
  expect_bits_of_new_jobs(scene, 8, [&](int k) { return query(k, 1); });
  expect_bits_of_new_jobs(with_uncertainty(scene), 4, [&](int k) { return query(k, 1); });
  expect_bits_of_new_jobs(scene, 4, [&](int k) { return query(k, 5); });                  // in parallel
  expect_bits_of_new_jobs(mixed_scene(80, 6, 3), 4, [&](int k) { return query(k, 1); });  // by a tree
}

TEST(JobPool, TheCurrentPosesAreAnsweredWithTheBitsOfNewJobs) {
  expect_bits_of_new_jobs(decomposed_scene(20, 1.5, 5), 2, [](int) {
    QueryView q;
    q.fields = kAllFields;
    return q;
  });
}

TEST(JobPool, JointsAreAnsweredWithTheBitsOfNewJobs) {
  for (const bool strange : {false, true}) {
    const Arm arm(12, strange);
    const auto seen = expect_bits_of_new_jobs(arm.scene, 12, [&](int k) { return arm.query(k); });
    EXPECT_GT(count_of(seen, Status::kOk), 0u);
    EXPECT_GT(count_of(seen, Status::kBeyond), 0u);
    EXPECT_GT(count_of(seen, Status::kOverlap), 0u);
    EXPECT_EQ(count_of(seen, Status::kBadPose) > 0, strange);
  }
}

TEST(JobPool, MotionsAreAnsweredWithTheBitsOfNewJobs) {
  constexpr int kCount = 8;
  const Arm arm(6 * kCount);
  std::array<std::uint64_t, 8> seen{};
  for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny})
    for (const std::uint32_t configurations : {2u, 6u}) {
      SCOPED_TRACE("reduce " + std::to_string(static_cast<int>(reduce)) + ", " + std::to_string(configurations));
      const engine::Engine kept(arm.scene, {.backend = "cpu", .threads = 2});
      const auto pool = std::make_shared<JobPool>();
      Held held;
      for (int k = 0; k < kCount; ++k) {
        QueryView q = arm.query(6 * k);
        q.fields = kDefaultFields | kFieldFlags | kFieldPoints | kFieldPair | kMotionFields;
        q.reduce = reduce;
        q.max_evaluations = 64;
        q.configuration_count = configurations;
        q.positions =
            std::span(arm.positions)
                .subspan(static_cast<std::size_t>(6 * k) * arm.joints.size(), configurations * arm.joints.size());
        const Answer answer = repeat(kept, q, pool), expected = repeat(kept, q, std::make_shared<JobPool>());
        expect_same(answer, expected);
        expect_same(held.answer(kept, q), expected);
        const std::uint64_t n = answer.info.rows;
        expect_same_column("time", answer.view.time, 0, expected.view.time, n, 1);
        expect_same_column("first_contact", answer.view.first_contact, 0, expected.view.first_contact, n, 2);
        expect_same_column("steps", answer.view.steps, 0, expected.view.steps, n, 1);
        if (::testing::Test::HasFatalFailure()) return;
        for (std::uint64_t i = 0; i < n; ++i) ++seen[answer.view.status[i]];
      }
      EXPECT_EQ(held.again, static_cast<std::uint64_t>(kCount - 1));
      EXPECT_EQ(jobs_reused(kept), 2 * held.again);
    }
  EXPECT_GT(count_of(seen, Status::kOk), 0u);
  EXPECT_GT(count_of(seen, Status::kBeyond), 0u);
  EXPECT_GT(count_of(seen, Status::kOverlap), 0u);
}

// A job's results about a scene and its poses are valid for these alone.
TEST(JobPool, NoneAnswersForASnapshotThatIsGone) {
  const Arm arm(1);
  engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1});
  const std::uint32_t ball = arm.scene.find_body("ball"), table = arm.scene.find_body("table"),
                      tool = arm.scene.robots()[0]->bodies.back();
  const std::vector<std::function<void(engine::Engine&)>> changes{
      [&](engine::Engine& e) {
        const BodyPose moved{ball, Pose{{0.3, 0.1, 0.4}}};
        e.set_poses({&moved, 1});
      },
      [&](engine::Engine& e) {
        const JointPosition moved{arm.joints.back(), 0.4};
        e.set_joints({&moved, 1});
      },
      [&](engine::Engine& e) { e.attach(ball, tool); },
      [&](engine::Engine& e) { e.attach(ball, kNone); },
      [&](engine::Engine& e) { e.allow(table, arm.scene.find_group("arm") | kGroupBit); },
      [&](engine::Engine& e) {
        const BodyPose bad{ball, Pose{{std::nan(""), 0, 0}}};
        e.set_poses({&bad, 1});
      }};
  QueryView q = arm.query();
  const std::span<const std::uint32_t> all_but_one = std::span(arm.joints).first(arm.joints.size() - 1);
  q.joints = all_but_one;
  q.positions = q.positions.first(all_but_one.size());
  std::map<Reduce, std::shared_ptr<JobPool>> pools;
  std::map<Reduce, Held> held;
  for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny, Reduce::kNearest}) {
    q.reduce = reduce;
    pools[reduce] = std::make_shared<JobPool>();
    repeat(engine, q, pools[reduce]);
    held[reduce].answer(engine, q);
  }
  for (std::size_t done = 1; done <= changes.size(); ++done) {
    engine::Engine other(arm.scene, {.backend = "cpu", .threads = 1});
    for (std::size_t i = 0; i < done; ++i) changes[i](other);
    changes[done - 1](engine);
    for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny, Reduce::kNearest}) {
      SCOPED_TRACE("change " + std::to_string(done) + ", reduce " + std::to_string(static_cast<int>(reduce)));
      q.reduce = reduce;
      const std::uint64_t before = jobs_reused(engine);
      EXPECT_FALSE(engine.has_job(q, pools[reduce]));
      const Answer now = repeat(engine, q, pools[reduce]), again = repeat(engine, q, pools[reduce]);
      EXPECT_TRUE(engine.has_job(q, pools[reduce]));
      EXPECT_EQ(jobs_reused(engine), before + 1);
      EXPECT_EQ(now.info.snapshot_revision, engine.pose_revision());
      EXPECT_EQ(again.info.snapshot_revision, engine.pose_revision());
      const Answer wanted = evaluate(other, q);
      expect_same(now, wanted);
      expect_same(again, wanted);
      for (const std::uint64_t known : {done - 1, done}) {
        const Answer by_held = held[reduce].answer(engine, q);
        EXPECT_EQ(by_held.info.snapshot_revision, engine.pose_revision());
        expect_same(by_held, wanted);
        EXPECT_EQ(held[reduce].again, known);
      }
    }
  }
}

// A plan made ahead of its configurations serves the first job of its snapshot, and no other.
TEST(JobPool, PlansMadeAheadGiveTheBitsOfNewOnes) {
  const Arm arm(4);
  engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1});
  const auto ahead = [&](QueryView q, const std::shared_ptr<JobPool>& pool) {
    q.positions = {};
    engine.plan_ahead(q, pool);
  };
  const std::uint32_t ball = arm.scene.find_body("ball");
  for (const Named& reduction : reductions())
    for (const char* then : {"run", "move", "more configurations"}) {
      SCOPED_TRACE(reduction.name + ", " + then);
      const auto pool = std::make_shared<JobPool>();
      QueryView q = arm.query();
      reduction.set(q);
      ahead(q, pool);
      if (then == std::string("move")) {
        const BodyPose moved{ball, Pose{{0.3, 0.1 + 1e-3 * static_cast<double>(reduction.name.size()), 0.4}}};
        engine.set_poses({&moved, 1});
      }
      if (then == std::string("more configurations")) {
        q.configuration_count = 3;
        q.positions = std::span(arm.positions).first(3 * arm.joints.size());
      }
      EXPECT_FALSE(engine.has_job(q, pool));
      expect_same(repeat(engine, q, pool), evaluate(engine, q));
    }
  QueryView wrong = arm.query();
  const std::vector<std::uint32_t> unknown{1000};
  wrong.joints = unknown;
  EXPECT_THROW(ahead(wrong, nullptr), engine::QueryError);
}

// A plan goes once a job of another number of configurations comes first.
TEST(JobPool, PlansMadeAheadServeTheFirstJobOrNone) {
  const Arm arm(3);
  const PoseStore store(arm.scene, std::chrono::seconds(1));
  const std::shared_ptr<const PoseSnapshot> snapshot = store.snapshot();
  QueryView one = arm.query(), three = one, ahead = one;
  three.configuration_count = 3;
  three.positions = arm.positions;
  ahead.positions = {};
  JobPool pool;
  const auto keep = [&] {
    auto planner = std::make_unique<Planner>(ahead, *snapshot->scene, snapshot, 1'000'000, false);
    WorkMeter unlimited;
    ASSERT_TRUE(planner->advance(unlimited));
    pool.keep_plan(std::move(planner));
  };
  keep();
  EXPECT_TRUE(pool.take_plan(one, snapshot));
  keep();
  EXPECT_FALSE(pool.take_plan(three, snapshot));
  EXPECT_FALSE(pool.take_plan(one, snapshot));
}

TEST(JobPool, WhatDependsOnTheClockIsNotKept) {
  const Arm arm(1);
  const std::vector<Named> questions{{"age", [](QueryView& q) { q.max_pose_age_ns = 1'000'000'000; }}};
  const Arm two(2);
  for (const Named& question : questions) {
    SCOPED_TRACE(question.name);
    const engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1});
    QueryView q = two.query();
    question.set(q);
    q.positions = std::span(two.positions).first(q.configuration_count * two.joints.size());
    const auto pool = std::make_shared<JobPool>();
    Held held;
    for (int i = 0; i < 3; ++i) repeat(engine, q, pool), held.answer(engine, q);
    EXPECT_FALSE(held.job);
    EXPECT_EQ(jobs_reused(engine), 0u);
  }
  engine::Scene moving = arm.scene;
  Body fast = moving.bodies()[moving.find_body("ball")];
  fast.name = "fast";
  fast.max_speed = 1;
  moving.add_body(std::move(fast));
  const engine::Engine engine(moving, {.backend = "cpu", .threads = 1});
  const auto pool = std::make_shared<JobPool>();
  for (int i = 0; i < 3; ++i) repeat(engine, arm.query(), pool);
  EXPECT_EQ(jobs_reused(engine), 0u);
}

// A job abandoned in the middle is not reused, and a query that never started loses nothing.
TEST(JobPool, OnlyWholeJobsComeBack) {
  const Arm arm(64);  // more than the fewest lanes answer at once
  const engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1, .instruction_set = "baseline"});
  const QueryView q = arm.query();
  const auto pool = std::make_shared<JobPool>();
  const Answer wanted = repeat(engine, q, pool);
  for (int i = 0; i < 2; ++i) {
    Answer room = empty_answer(engine, q);
    Job job = engine.start(engine.prepare(q, pool), room.view);
    EXPECT_FALSE(job.advance(WorkBudget{.units = 0}));
    EXPECT_EQ(jobs_reused(engine), 1u);  // the second time there was none
  }
  expect_same(repeat(engine, q, pool), wanted);
  EXPECT_EQ(jobs_reused(engine), 1u);
  for (int i = 0; i < 3; ++i) {
    const PreparedQuery prepared = engine.prepare(q, pool);
    EXPECT_EQ(prepared.size().rows, wanted.size.rows);
  }
  EXPECT_EQ(jobs_reused(engine), 4u);
  QueryView few = q;
  few.positions = few.positions.first(1);
  EXPECT_THROW(engine.prepare(few, pool), engine::QueryError);
  expect_same(repeat(engine, q, pool), wanted);
  EXPECT_EQ(jobs_reused(engine), 5u);
}

TEST(JobPool, ThreadsThatAskAtATimeGetTheirOwnAnswers) {
  constexpr int kThreads = 4, kRounds = 50;
  const Arm arm(kRounds);
  const engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1});
  const auto pool = std::make_shared<JobPool>();
  std::vector<Answer> wanted;
  const auto query = [&](int k) {
    QueryView q = arm.query(k);
    q.reduce = Reduce::kMin;
    return q;
  };
  for (int k = 0; k < kRounds; ++k) wanted.push_back(evaluate(engine, query(k)));
  std::array<std::vector<Answer>, kThreads> found;
  std::vector<std::thread> threads;
  for (auto& answers : found)
    threads.emplace_back([&] {
      for (int k = 0; k < kRounds; ++k) answers.push_back(repeat(engine, query(k), pool));
    });
  std::array<Held, kThreads> held;
  std::array<std::vector<Answer>, kThreads> by_held;
  for (std::size_t i = 0; i < kThreads; ++i)
    threads.emplace_back([&, i] {
      held[i].pool = pool;
      for (int k = 0; k < kRounds; ++k) by_held[i].push_back(held[i].answer(engine, query(k)));
    });
  for (std::thread& thread : threads) thread.join();
  for (const auto& answers : found)
    for (std::size_t k = 0; k < kRounds; ++k) expect_same(answers[k], wanted[k]);
  for (const auto& answers : by_held)
    for (std::size_t k = 0; k < kRounds; ++k) expect_same(answers[k], wanted[k]);
  for (const Held& one : held) EXPECT_EQ(one.again, kRounds - 1u);
  EXPECT_GE(jobs_reused(engine), std::uint64_t{kThreads * (kRounds - 1)});
}

// Jobs wait while numbers of configurations alternate, and beyond the limit the oldest goes.
TEST(JobPool, KeepsJobsOfSeveralNumbersOfConfigurations) {
  const Arm arm(6);
  const engine::Engine engine(arm.scene, {.backend = "cpu", .threads = 1});
  const auto pool = std::make_shared<JobPool>(2);
  const auto ask = [&](std::uint32_t count) {
    QueryView q = arm.query();
    q.configuration_count = count;
    q.positions = std::span(arm.positions).first(count * arm.joints.size());
    const std::uint64_t before = jobs_reused(engine);
    const bool has = engine.has_job(q, pool);
    expect_same(repeat(engine, q, pool), repeat(engine, q, std::make_shared<JobPool>()));
    EXPECT_EQ(has, jobs_reused(engine) > before);
    EXPECT_FALSE(engine.has_job(q, nullptr));
    return has;
  };
  EXPECT_FALSE(ask(1));
  EXPECT_FALSE(ask(6));
  EXPECT_TRUE(ask(1));
  EXPECT_TRUE(ask(6));
  EXPECT_FALSE(ask(3));
  EXPECT_FALSE(ask(1));  // 3 has replaced it
  EXPECT_TRUE(ask(3));
}

// Jobs beyond the small ones are kept as long as all jobs of the pool are within its limit.
TEST(JobPool, KeepsLargeJobsWithinALimitForAll) {
  const engine::Scene scene = decomposed_scene(30, 1.5, 7);
  const engine::Engine engine(scene, {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  const auto pool = std::make_shared<JobPool>(2);
  const std::vector<std::uint32_t> bodies{0, 3};
  Random random(5);
  std::vector<Pose> poses(2 * 2048);
  for (Pose& pose : poses) pose = random.pose(1.5);
  QueryView q;
  q.reduce = Reduce::kMin;
  q.bodies = bodies;
  q.configuration_count = 1;
  q.configurations = std::span(poses).first(2);
  const std::uint64_t pairs = engine.prepare(q).size().pairs;
  const auto runs_again = [&](std::uint64_t rows) {
    q.configuration_count = static_cast<std::uint32_t>(rows / pairs);
    q.configurations = std::span(poses).first(2 * q.configuration_count);
    const bool has = engine.has_job(q, pool);
    expect_same(repeat(engine, q, pool), repeat(engine, q, std::make_shared<JobPool>()));
    return has;
  };
  constexpr std::uint64_t kShare = JobPool::kShare;
  ASSERT_GT(pairs, 3 * kShare / 2048);
  EXPECT_FALSE(runs_again(kShare / 2));
  EXPECT_FALSE(runs_again(3 * kShare / 2));
  EXPECT_TRUE(runs_again(kShare / 2));  // both fit
  EXPECT_TRUE(runs_again(3 * kShare / 2));
  EXPECT_FALSE(runs_again(kShare));  // replaces the oldest
  EXPECT_TRUE(runs_again(kShare));
  EXPECT_FALSE(runs_again(2 * kShare));  // replaces all
  EXPECT_TRUE(runs_again(2 * kShare));
  EXPECT_FALSE(runs_again(kShare));
  EXPECT_FALSE(runs_again(3 * kShare));  // is too large
  EXPECT_FALSE(runs_again(3 * kShare));
}

// A change of the scene replaces the engine, while a prepared query keeps its pool.
TEST(JobPool, OutlivesTheEngine) {
  for (const engine::Scene& scene : {decomposed_scene(30, 1.5, 7), mixed_scene(80, 6, 3)}) {  // the second by a tree
    const auto pool = std::make_shared<JobPool>();
    const std::vector<std::uint32_t> bodies{0, 3};
    Random random(4);
    const std::vector<Pose> poses{random.pose(1.5), random.pose(1.5)};
    QueryView q;
    q.reduce = Reduce::kMin;
    q.bodies = bodies;
    q.configuration_count = 1;
    q.configurations = poses;
    std::optional<engine::Engine> engine;
    for (int i = 0; i < 3; ++i) {
      engine.emplace(scene, engine::Engine::Options{.backend = "cpu", .threads = 1});
      const Answer first = repeat(*engine, q, pool);
      EXPECT_EQ(jobs_reused(*engine), 0u);
      expect_same(first, evaluate(*engine, q));
      expect_same(repeat(*engine, q, pool), first);
      EXPECT_EQ(jobs_reused(*engine), 1u);
    }
    engine.reset();
  }
}

}  // namespace
}  // namespace clearance::test
