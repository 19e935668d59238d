// The bits of an answer do not depend on the rest of the query: pairs fill lanes with any hulls, bodies of several
// convex parts search in rounds, and each pair gets the same result as alone.
#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <vector>

#include "engine/cost/team_cost.h"
#include "engine/narrow/lanes.h"
#include "tests/engine/engine_test_util.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {
namespace {

// Bodies of one to five convex parts, of 1 to 150 vertices, some of them rounded; the first two share their parts.
engine::Scene parts_scene(Random& random, int count) {
  engine::Scene scene;
  std::vector<ConvexPartPtr> shared;
  for (int i = 0; i < count; ++i) {
    Body body;
    body.name = "body" + std::to_string(i);
    const int parts = i % 3 == 0 ? 1 : 1 + static_cast<int>(random.below(5));
    for (int p = 0; p < parts; ++p) {
      const int sizes[] = {1, 2, 8, 30, 64, 150};
      std::vector<Vec3d> cloud = random.cloud(sizes[random.below(6)], {0.2, 0.2, 0.2});
      for (Vec3d& v : cloud) v += Vec3d{0.7 * p, random.uniform(-0.3, 0.3), 0};
      body.parts.push_back(make_convex_part(std::move(cloud), random.below(3) == 0 ? 0.05 : 0));
    }
    if (i == 0) shared = body.parts;
    if (i == 1) body.parts = shared;
    scene.add_body(std::move(body));
  }
  return scene;
}

TEST(Batches, GiveEachPairTheBitsThatItHasAlone) {
  constexpr std::uint32_t kBodies = 12, kConfigurations = 9;
  Random random(3);
  std::vector<std::uint32_t> moved;
  std::vector<Pose> poses;
  for (std::uint32_t b = 0; b < kBodies; ++b) moved.push_back(b);
  for (std::uint32_t i = 0; i < kBodies * kConfigurations; ++i) poses.push_back(random.pose(2.5));
  std::array<std::uint64_t, 8> seen{};
  for (const LaneKernel& kernel : lane_kernels()) {
    Random same(4);
    engine::Engine::Options options;
    options.instruction_set = kernel.name;
    const engine::Engine engine(parts_scene(same, kBodies), options);
    for (const Precision precision : {Precision::kF64, Precision::kF32})
      for (const bool signed_distance : {false, true})
        for (const double max_distance : {1.0, std::numeric_limits<double>::infinity()}) {
          QueryView query;
          query.precision = precision;
          query.signed_distance = signed_distance;
          query.max_distance = max_distance;
          query.fields = kAllFields;
          query.bodies = moved;
          query.configuration_count = kConfigurations;
          query.configurations = poses;
          expect_rows_as_alone(engine, query, seen);
          if (HasFatalFailure())
            FAIL() << kernel.name << ", f32 " << (precision == Precision::kF32) << ", signed " << signed_distance
                   << ", within " << max_distance;
        }
  }
  for (const Status status : {Status::kOk, Status::kOverlap, Status::kBeyond})
    EXPECT_GT(seen[static_cast<std::size_t>(status)], 20u) << "status " << int(status) << " was not met";
}

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(TeamCost, FollowsWhatTeamsCostAndForgets) {
  TeamCost cost;
  const TeamCost::Clock::time_point now{};
  cost.set(TeamCost::kFirst, now);
  EXPECT_FALSE(cost.is_worth(500e-6, 16, now))
      << "500 us are what it is taken for at first, and one thread has its share";
  EXPECT_TRUE(cost.is_worth(600e-6, 16, now));
  cost.learn(milliseconds(20), microseconds(300), now);
  EXPECT_FALSE(cost.is_worth(20e-3, 2, now)) << "half of 19.7 ms, which were lost, and of 0.5";
  EXPECT_TRUE(cost.is_worth(21e-3, 2, now));
  EXPECT_TRUE(cost.is_worth(6e-3, 16, now + seconds(1))) << "half of that after a second";
  EXPECT_FALSE(cost.is_worth(5e-3, 16, now + seconds(1)));
  for (int i = 0; i < 10; ++i) cost.learn(milliseconds(1), milliseconds(8), now);
  EXPECT_TRUE(cost.is_worth(220e-6, 2, now)) << "teams that gain time cost what they do on a quiet machine";
  EXPECT_FALSE(cost.is_worth(180e-6, 2, now));
  EXPECT_FALSE(cost.is_worth(180e-6, 2, now + seconds(1000)));
}

// Answers do not depend on the team, and small batches use one thread at any cost of a team.
TEST(Batches, HaveATeamWhereOneIsWorthIt) {
  Random random(5);
  engine::Engine::Options options;
  options.threads = 4;
  const engine::Engine engine(parts_scene(random, 12), options);
  std::vector<std::uint32_t> moved(12);
  for (std::uint32_t b = 0; b < 12; ++b) moved[b] = b;
  std::vector<Pose> poses;
  for (int i = 0; i < 12 * 200; ++i) poses.push_back(random.pose(2.5));
  const auto teams = [&] {
    for (const auto& [name, value] : engine.stats())
      if (name == "engine.teams") return value;
    return ~std::uint64_t{0};
  };
  QueryView query;
  query.fields = kAllFields;
  query.bodies = moved;
  const auto answer = [&](std::uint32_t count, std::chrono::nanoseconds cost) {
    team_cost().set(cost, TeamCost::Clock::now());
    query.configuration_count = count;
    query.configurations = std::span(poses).first(12 * count);
    return evaluate(engine, query);
  };
  answer(3, {});
  EXPECT_EQ(teams(), 0u) << "198 pairs";
  const Answer alone = answer(200, std::chrono::hours(1000));
  EXPECT_EQ(teams(), 0u) << "nothing is worth that";
  const Answer shared = answer(200, {});
  EXPECT_GT(teams(), 0u);
  expect_same_rows(alone, 0, shared, alone.info.rows);

  const std::uint64_t before = teams();
  query.reduce = Reduce::kAny;
  query.max_evaluations = 64;
  query.fields = kDefaultFields | kFieldPair;
  const Answer motions_alone = answer(200, std::chrono::hours(1000));
  EXPECT_EQ(teams(), before) << "100 motions, and nothing is worth that";
  const Answer motions_shared = answer(200, {});
  EXPECT_GT(teams(), before);
  expect_same_rows(motions_alone, 0, motions_shared, motions_alone.info.rows);
  team_cost().set(TeamCost::kFirst, TeamCost::Clock::now());
}

}  // namespace
}  // namespace clearance::test
