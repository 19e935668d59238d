// Queries that are answered again by a job, from a pool or held.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "engine/query/job_pool.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {

inline std::uint64_t jobs_reused(const engine::Engine& engine) {
  for (const auto& [name, value] : engine.stats())
    if (name == "engine.jobs_reused") return value;
  ADD_FAILURE() << "no such counter";
  return 0;
}

/// Compares two answers completely.
inline void expect_same(const Answer& a, const Answer& b) {
  ASSERT_EQ(a.info.rows, b.info.rows);
  ASSERT_EQ(a.info.total, b.info.total);
  ASSERT_EQ(a.info.pairs_evaluated, b.info.pairs_evaluated);
  expect_same_rows(a, 0, b, a.info.rows);
  const std::uint64_t n = a.info.rows;
  expect_same_column("gradient_joints", a.view.gradient_joints, 0, b.view.gradient_joints, n, a.size.joints);
  expect_same_column("pair_lower", a.view.pair_lower, 0, b.view.pair_lower, n, 1);
}

/// Answers a query by a job of the pool, if there is one.
inline Answer repeat(const engine::Engine& engine, const QueryView& query, const std::shared_ptr<JobPool>& pool) {
  Answer a = empty_answer(engine, query);
  Job job = engine.start(engine.prepare(query, pool), a.view);
  while (!job.advance()) {
  }
  a.info = job.info();
  return a;
}

/// Answers queries that differ in their configurations alone, each by the job of the one before if it can.
struct Held {
  std::shared_ptr<JobPool> pool = std::make_shared<JobPool>();
  std::optional<Job> job{};
  std::uint64_t again = 0;  // answers by that job

  Answer answer(const engine::Engine& engine, const QueryView& query) {
    Answer a = empty_answer(engine, query);
    if (job && engine.answer_again(*job, query, a.view)) {
      ++again;
      a.info = job->info();
      return a;
    }
    job.reset();
    Job made = engine.start(engine.prepare(query, pool), a.view);
    while (!made.advance()) {
    }
    a.info = made.info();
    if (made.rest()) job.emplace(std::move(made));
    return a;
  }
};

/// The arm, and rows of positions for its joints, some beyond their limits and some not finite.
struct Arm {
  engine::Scene scene = arm_scene(at_home());
  std::vector<std::uint32_t> joints = joints_of(scene, "arm");
  std::vector<double> positions;

  explicit Arm(int rows, bool strange = false) {
    scene.ignore("arm", "arm");  // two links that always overlap would decide everything
    scene.add_sphere("rock", 0.3, {.is_static = true, .pose = Pose{{0.3, -0.3, 0.4}}});
    Random random(2);
    for (std::size_t i = 0; i < static_cast<std::size_t>(rows) * joints.size(); ++i)
      positions.push_back(strange && i % 5 == 3 ? 50 : strange && i % 17 == 11 ? 1e7 : random.uniform(-1.5, 1.5));
  }
  QueryView query(int row = 0) const {
    QueryView q;
    q.fields = kAllFields | kFieldGradientJoints | kFieldPairLower;
    q.joints = joints;
    q.configuration_count = 1;
    q.positions = std::span(positions).subspan(static_cast<std::size_t>(row) * joints.size(), joints.size());
    return q;
  }
};

}  // namespace clearance::test
