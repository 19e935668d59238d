// Rows of uncertain bodies: reductions compared with all pairs, the pair of the least lower bound, and bounds in float32.
#include <algorithm>
#include <cmath>

#include "engine/narrow/answer.h"
#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

// mixed_scene() with bodies of uncertain rotation, each by a different angle; some of them follow others.
engine::Scene uncertain_scene(int count, double box, std::uint64_t seed) {
  const engine::Scene known = mixed_scene(count, box, seed);
  engine::Scene scene;
  Random random(seed);
  for (Body body : known.bodies()) {
    if (random.below(2) == 0) body.uncertainty = {0.01, random.uniform(0, 0.5)};
    if (!body.is_static && random.below(6) == 0 && !scene.bodies().empty()) body.parent = 0;
    body.max_speed = random.below(4) == 0 ? 1e-9 : 0;  // has an age, but a negligible one
    scene.add_body(std::move(body));
  }
  return scene;
}

// Checks that two bounds agree except for possible motion in the time between two queries.
void expect_near(double a, double b) {
  if (a != b) {  // equal infinities pass
    EXPECT_NEAR(a, b, 1e-6);
  }
}

// A slack within the tolerance, and parts within the tolerance, that exceed it together.
TEST(Decide, WiderThanItsToleranceARowThatConvergedHasTheFlagOfItsSlack) {
  NarrowLimits limits;
  limits.abs_tol = 1e-4;
  limits.rel_tol = 0;
  const auto decided = [&](double width, const Slack& slack) {
    PairAnswer answer = beyond_answer(0);
    decide(limits, 2, 2 + width, [] { return 0.0; }, answer, slack);
    return answer;
  };
  for (const Slack& slack : {Slack{8e-5, 0}, Slack{0, 8e-5}, Slack{4e-5, 4e-5}}) {
    const PairAnswer wide = decided(3e-5, slack), narrow = decided(1e-5, slack), open = decided(2e-4, slack);
    EXPECT_EQ(wide.status, Status::kOk);
    EXPECT_GT(wide.upper - wide.lower, limits.abs_tol);
    EXPECT_EQ(wide.flags, kFlagUncertaintyLimited);
    EXPECT_EQ(narrow.status, Status::kOk);
    EXPECT_LE(narrow.upper - narrow.lower, limits.abs_tol);
    EXPECT_EQ(narrow.flags, 0);
    EXPECT_EQ(open.status, Status::kUnconverged);
    EXPECT_EQ(open.flags, 0);
  }
}

TEST_P(EngineTest, UncertainReductionsAgreeWithAllPairs) {
  for (const std::string broad_phase : {"brute", "tree"}) {
    engine::Engine::Options options{GetParam(), 2};
    options.broad_phase = broad_phase;
    const engine::Engine engine(uncertain_scene(60, 4, 3), options);
    QueryView all;
    all.fields = kAllFields | kFieldPairLower;
    const Answer dense = evaluate(engine, all);
    const std::vector<BodyPair> pairs = engine.pairs(all);
    std::vector<double> upper(60, kInf), lower(60, kInf);
    int uncertain = 0, pairs_differ = 0;
    const auto at = [&](BodyPair pair) {
      return static_cast<std::size_t>(std::find(pairs.begin(), pairs.end(), pair) - pairs.begin());
    };
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      EXPECT_EQ(dense.view.pair_lower[i], pairs[i]);
      uncertain += (dense.view.flags[i] & kFlagUncertaintyLimited) != 0;
      for (const std::uint32_t body : {pairs[i].a, pairs[i].b}) {
        lower[body] = std::min(lower[body], dense.view.lower[i]);
        upper[body] = std::min(upper[body], dense.view.upper[i]);
      }
    }
    EXPECT_GT(uncertain, 500);
    QueryView q = all;
    q.reduce = Reduce::kNearest;
    const Answer nearest = evaluate(engine, q);
    ASSERT_EQ(nearest.info.rows, 60u);
    for (std::uint32_t body = 0; body < 60; ++body) {
      expect_near(nearest.view.upper[body], upper[body]);
      expect_near(nearest.view.lower[body], lower[body]);
      expect_near(dense.view.upper[at(nearest.view.pair[body])], upper[body]);
      expect_near(dense.view.lower[at(nearest.view.pair_lower[body])], lower[body]);
      pairs_differ += nearest.view.pair[body] != nearest.view.pair_lower[body];
    }
    EXPECT_GT(pairs_differ, 0) << "no row tells the two apart";
    q.reduce = Reduce::kMin;
    const Answer min = evaluate(engine, q);
    expect_near(min.view.upper[0], *std::min_element(upper.begin(), upper.end()));
    expect_near(min.view.lower[0], *std::min_element(lower.begin(), lower.end()));
    q.reduce = Reduce::kWithin;
    q.max_distance = 0.3;
    const Answer within = evaluate(engine, q);
    std::size_t expected = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) expected += !(dense.view.lower[i] > 0.3);
    EXPECT_EQ(within.info.rows, expected);
    EXPECT_GT(expected, 20u);
    for (std::size_t i = 0; i < within.info.rows; ++i) EXPECT_EQ(within.view.pair_lower[i], within.view.pair[i]);
  }
}

// The flag depends only on uncertainty, whether SIMD lanes, a scalar run or a device thread computed the pair.
TEST_P(EngineTest, BodiesThatMayTouchAreNonsmooth) {
  engine::Scene scene;
  scene.add_box("known", {1, 1, 1}, {.pose = Pose{}});
  scene.add_box("unsure", {1, 1, 1}, {.pose = Pose{}, .uncertainty = {0, 0.08}});
  const engine::Engine engine = make(std::move(scene));
  Random random(8);
  std::vector<Pose> poses;
  for (int k = 0; k < 400; ++k) {
    poses.push_back(random.pose(0));
    poses.back().translation = {random.uniform(1, 1.5), random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3)};
  }
  const std::uint32_t moved[] = {0};
  QueryView q;
  q.bodies = moved;
  q.configurations = poses;
  q.configuration_count = 400;
  q.fields = kAllFields;
  const Answer rows = evaluate(engine, q);
  int may_touch = 0, smooth = 0;
  for (std::uint64_t i = 0; i < rows.info.rows; ++i) {
    const bool is_nonsmooth = (rows.view.flags[i] & kFlagNonsmooth) != 0;
    smooth += !is_nonsmooth;
    if (rows.view.lower[i] > 0 || static_cast<Status>(rows.view.status[i]) != Status::kContact) continue;
    EXPECT_TRUE(is_nonsmooth) << i;
    may_touch += rows.view.upper[i] > 1e-3;
  }
  EXPECT_GT(may_touch, 20);
  EXPECT_GT(smooth, 20);
}

TEST_P(EngineTest, TheLeastLowerBoundMayBeAnotherPairs) {
  engine::Scene scene;
  scene.add_sphere("a", 0.5, {.pose = Pose{}});
  scene.add_sphere("near", 0.5, {.pose = Pose{{2, 0, 0}}});
  engine::Scene::BodyOptions unsure;
  unsure.pose = Pose{{0, 3, 0}};
  unsure.uncertainty.angle = 1;
  scene.add_box("far", {2, 2, 2}, unsure);  // 1.5 m away; a rotation may move its corners by more
  const engine::Engine engine = make(std::move(scene));
  const BodyPair pairs[] = {{0, 1}, {0, 2}};
  QueryView q;
  q.pairs = pairs;
  q.all_pairs = false;
  q.reduce = Reduce::kMin;
  q.fields = kDefaultFields | kFieldPair | kFieldPairLower | kFieldFlags;
  const Answer r = evaluate(engine, q);
  EXPECT_EQ(r.view.pair[0], pairs[0]);
  EXPECT_EQ(r.view.pair_lower[0], pairs[1]);
  EXPECT_NEAR(r.view.upper[0], 1, 1e-6);
  EXPECT_EQ(r.view.lower[0], 0) << "it may touch: sqrt(3) * 2 sin(1/2) = 1.66 > 1.5";
}

TEST_P(EngineTest, ABitOfNoColumnIsRejected) {
  const engine::Engine engine = make(mixed_scene(2, 1, 1));
  QueryView q;
  q.fields = kDefaultFields | 1u << kFieldCount;
  EXPECT_THROW(engine.size(q), engine::QueryError);
}

TEST_P(EngineTest, Float32BoundsHoldSlackToo) {
  const engine::Engine engine = make(uncertain_scene(24, 3, 5));
  QueryView q;
  q.fields = kDefaultFields;
  const Answer full = evaluate(engine, q);
  q.fields = kFieldBounds;
  const Answer rounded = evaluate(engine, q);
  for (std::size_t i = 0; i < full.info.rows; ++i) {
    EXPECT_LE(rounded.view.bounds[2 * i], full.view.lower[i] + 1e-6);
    EXPECT_GE(rounded.view.bounds[2 * i + 1], full.view.upper[i]);
  }
}

}  // namespace
}  // namespace clearance::test
