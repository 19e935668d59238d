// Work that a query can skip is skipped: counted, not timed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/engine/engine_test_util.h"

namespace clearance {
namespace {

using test::Answer;
using test::evaluate;
using test::mixed_scene;

constexpr double kInf = std::numeric_limits<double>::infinity();

std::uint64_t counter(const engine::Engine& engine, const std::string& name) {
  for (const auto& [key, value] : engine.stats())
    if (key == name) return value;
  ADD_FAILURE() << "no counter " << name;
  return 0;
}

TEST(WorkLeftOut, StaticIgnoredAndFollowingPairsAreNeverEvaluated) {
  engine::Scene scene = mixed_scene(40, 3, 1);
  scene.set_parent("body1", "body0");
  scene.ignore("body2", "*");
  const std::size_t bodies = scene.bodies().size();
  const auto fixed = static_cast<std::size_t>(
      std::count_if(scene.bodies().begin(), scene.bodies().end(), [](const Body& b) { return b.is_static; }));
  ASSERT_EQ(fixed, 8u);
  const engine::Engine engine(std::move(scene), test::kWithoutCovers);
  const std::uint64_t wanted = bodies * (bodies - 1) / 2  // all
                               - fixed * (fixed - 1) / 2  // two static bodies
                               - 1                        // parent and child
                               - (bodies - 1);            // ignored
  const Answer answer = evaluate(engine, {});
  EXPECT_EQ(answer.info.rows, wanted);
  EXPECT_EQ(answer.info.pairs_evaluated, wanted);
  EXPECT_EQ(counter(engine, "engine.pairs_evaluated"), wanted);
}

TEST(WorkLeftOut, ConfigurationsTouchOnlyPairsOfMovedBodies) {
  const engine::Engine engine(mixed_scene(40, 3, 2), test::kWithoutCovers);
  const std::uint32_t moved[] = {3, 10};
  test::Random random(5);
  std::vector<Pose> poses;
  for (int i = 0; i < 6; ++i) poses.push_back(random.pose(3));
  QueryView query;
  query.configuration_count = 3;
  query.bodies = moved;
  query.configurations = poses;
  const Answer answer = evaluate(engine, query);
  EXPECT_EQ(answer.size.pairs, 39u + 38u);
  EXPECT_EQ(answer.info.pairs_evaluated, 3 * answer.size.pairs);
}

TEST(WorkLeftOut, BoxesAnswerForPairsFartherThanMaxDistance) {
  const engine::Scene scene = mixed_scene(60, 12, 3);
  QueryView query;
  query.max_distance = 0.5;
  const engine::Engine engine(scene, test::kWithoutCovers);
  const Answer answer = evaluate(engine, query);
  std::uint64_t refined = 0, beyond = 0;
  for (std::uint64_t i = 0; i < answer.info.rows; ++i) {
    const auto status = static_cast<Status>(answer.view.status[i]);
    beyond += status == Status::kBeyond;
    refined += answer.view.upper[i] < kInf;
    EXPECT_TRUE(answer.view.upper[i] < kInf || status == Status::kBeyond);
  }
  EXPECT_GT(beyond, answer.info.rows / 2) << "the scene is too dense for this test";
  EXPECT_EQ(answer.info.pairs_evaluated, refined);
  EXPECT_LT(refined, answer.info.rows / 10);
  EXPECT_GT(refined, 0u);

  // The same pairs, found by reduction, which evaluates no more of them.
  query.reduce = Reduce::kWithin;
  const Answer within = evaluate(engine, query);
  EXPECT_EQ(within.info.pairs_evaluated, refined);
  EXPECT_LE(within.info.rows, refined);
  EXPECT_EQ(within.info.rows, answer.info.rows - beyond);

  // The oracle evaluates all of them.
  query.reduce = Reduce::kNone;
  engine::Engine::Options options;
  options.backend = "reference";
  const Answer oracle = evaluate(engine::Engine(scene, options), query);
  EXPECT_EQ(oracle.info.pairs_evaluated, oracle.info.rows);
}

TEST(WorkLeftOut, BodiesWithoutAPoseCostNothing) {
  engine::Scene scene;
  for (const char* name : {"a", "b", "c"}) scene.add_sphere(name, 0.1, {});
  engine::Engine engine(std::move(scene), test::kWithoutCovers);
  const BodyPose poses[] = {{0, {}}, {1, {{1, 0, 0}}}};
  engine.set_poses(poses);
  const Answer answer = evaluate(engine, {});
  EXPECT_EQ(answer.info.rows, 3u);
  EXPECT_EQ(answer.info.pairs_evaluated, 1u);
}

}  // namespace
}  // namespace clearance
