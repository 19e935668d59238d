// Reductions of the engine as a whole, compared with all pairs.
#include <algorithm>
#include <cmath>
#include <set>

#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

TEST_P(EngineTest, NearestAndMinAgreeWithAllPairs) {
  const engine::Engine engine = make(mixed_scene(60, 4, 3));
  QueryView all;
  all.fields = kAllFields;
  const Answer dense = evaluate(engine, all);
  const std::vector<BodyPair> pairs = engine.pairs(all);
  ASSERT_EQ(pairs.size(), dense.info.rows);
  std::vector<double> least_upper(60, kInf), least_lower(60, kInf);
  std::vector<BodyPair> winner(60);
  for (std::size_t i = 0; i < pairs.size(); ++i)
    for (const std::uint32_t body : {pairs[i].a, pairs[i].b}) {
      least_lower[body] = std::min(least_lower[body], dense.view.lower[i]);
      if (dense.view.upper[i] < least_upper[body]) {
        least_upper[body] = dense.view.upper[i];
        winner[body] = pairs[i];
      }
    }
  QueryView q = all;
  q.reduce = Reduce::kNearest;
  const Answer nearest = evaluate(engine, q);
  ASSERT_EQ(nearest.info.rows, 60u);
  for (std::uint32_t body = 0; body < 60; ++body) {
    EXPECT_EQ(nearest.view.upper[body], least_upper[body]) << body;
    EXPECT_EQ(nearest.view.lower[body], least_lower[body]) << body;
    EXPECT_EQ(nearest.view.pair[body], winner[body]) << body;
  }
  if (GetParam() == "cpu") {
    EXPECT_LT(nearest.info.pairs_evaluated, pairs.size() / 2) << "nothing was left out";
  }
  q.reduce = Reduce::kMin;
  const Answer min = evaluate(engine, q);
  ASSERT_EQ(min.info.rows, 1u);
  EXPECT_EQ(min.view.upper[0], *std::min_element(least_upper.begin(), least_upper.end()));
  EXPECT_EQ(min.view.lower[0], *std::min_element(least_lower.begin(), least_lower.end()));
}

// For body g: the rod has the nearest box and is far; h is beyond max_distance, and g is its nearest; y is nearer than
// h, and has a nearer neighbour than g itself.
TEST_P(EngineTest, NearestHoldsPairsThatAreBeyondAndNobodysNearestBoxes) {
  engine::Scene scene;
  const double c = std::sqrt(0.5), s = std::sin(std::atan(1) / 2);
  scene.add_sphere("g", 0.1, {.pose = Pose{}});
  scene.add_box("rod", {2, 0.02, 0.02}, {.pose = Pose{{0.75, 0.75, 0}, std::sqrt(1 - s * s), 0, 0, -s}});
  scene.add_sphere("h", 0.1, {.pose = Pose{{-0.7, 0, 0}}});
  scene.add_sphere("y", 0.1, {.pose = Pose{{0, -0.65, 0}}});
  scene.add_sphere("z", 0.1, {.pose = Pose{{0, -0.9, 0}}});
  const engine::Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  const Answer dense = evaluate(engine, q);
  ASSERT_NEAR(dense.view.distance[0], 1.5 * c - 0.1 - 0.01, 0.02) << "g and the rod";
  q.reduce = Reduce::kNearest;
  q.max_distance = 0.3;
  const Answer nearest = evaluate(engine, q);
  EXPECT_EQ(static_cast<Status>(nearest.view.status[0]), Status::kBeyond);
  EXPECT_LE(nearest.view.lower[0], 0.45 + 1e-12) << "y";
  EXPECT_GT(nearest.view.lower[0], 0.3);
}

// Touching boxes do not reveal which of two overlaps is deeper.
TEST_P(EngineTest, NearestAndMinFindTheDeepestOverlap) {
  const engine::Engine engine = make(mixed_scene(40, 1, 6));
  QueryView q;
  q.fields = kAllFields;
  q.signed_distance = true;
  const Answer dense = evaluate(engine, q);
  const std::vector<BodyPair> pairs = engine.pairs(q);
  std::vector<double> least(40, kInf);
  int overlaps = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    overlaps += dense.view.upper[i] < 0;
    for (const std::uint32_t body : {pairs[i].a, pairs[i].b}) least[body] = std::min(least[body], dense.view.upper[i]);
  }
  ASSERT_GT(overlaps, 100);
  q.reduce = Reduce::kNearest;
  const Answer nearest = evaluate(engine, q);
  for (std::uint32_t body = 0; body < 40; ++body) EXPECT_EQ(nearest.view.upper[body], least[body]) << body;
  q.reduce = Reduce::kMin;
  EXPECT_EQ(evaluate(engine, q).view.upper[0], *std::min_element(least.begin(), least.end()));
}

// The first overlapping pair wins, for any pairs after it.
TEST_P(EngineTest, MinIsTheFirstOverlap) {
  const engine::Engine engine = make(mixed_scene(60, 1.2, 5));
  Random random(6);
  const std::vector<std::uint32_t> bodies{1, 2, 3};
  std::vector<Pose> poses;
  for (int i = 0; i < 40 * 3; ++i) poses.push_back(random.pose(i < 90 ? 1.2 : 60));
  QueryView q;
  q.fields = kAllFields;
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = 40;
  const Answer dense = evaluate(engine, q);
  const std::vector<BodyPair> pairs = engine.pairs(q);
  q.max_distance = 0;
  const std::uint64_t touching = evaluate(engine, q).info.pairs_evaluated;
  q.max_distance = kInf;
  q.reduce = Reduce::kMin;
  const Answer min = evaluate(engine, q);
  ASSERT_EQ(min.info.rows, 40u);
  int overlapping = 0;
  for (std::size_t k = 0; k < 40; ++k) {
    const std::uint8_t* status = dense.view.status + k * pairs.size();
    const auto first =
        static_cast<std::size_t>(std::find(status, status + pairs.size(), std::uint8_t(Status::kOverlap)) - status);
    if (first == pairs.size()) continue;
    ++overlapping;
    EXPECT_EQ(min.view.status[k], std::uint8_t(Status::kOverlap)) << k;
    EXPECT_EQ(min.view.pair[k], pairs[first]) << k;
    EXPECT_EQ(min.view.lower[k], 0) << k;
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_EQ(min.view.point_a[3 * k + c], dense.view.point_a[3 * (k * pairs.size() + first) + c]);
  }
  EXPECT_GT(overlapping, 20);
  EXPECT_LT(overlapping, 40);
  if (GetParam() == "cpu") {
    EXPECT_LT(min.info.pairs_evaluated, touching / 2);
  }
}

TEST_P(EngineTest, WithinKeepsExactlyThePairsNotProvedFarther) {
  const engine::Engine engine = make(mixed_scene(60, 4, 3));
  QueryView all;
  all.fields = kAllFields;
  const Answer dense = evaluate(engine, all);
  const std::vector<BodyPair> pairs = engine.pairs(all);
  QueryView q = all;
  q.reduce = Reduce::kWithin;
  q.max_distance = 2;
  const Answer within = evaluate(engine, q);
  std::set<BodyPair> found(within.view.pair, within.view.pair + within.info.rows);
  ASSERT_EQ(found.size(), within.info.rows);
  std::size_t near = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (dense.view.upper[i] <= 2) {
      EXPECT_TRUE(found.count(pairs[i]));
      ++near;
    }
    if (dense.view.lower[i] > 2) {
      EXPECT_FALSE(found.count(pairs[i]));
    }
  }
  ASSERT_GT(near, 20u);
  ASSERT_LT(near, pairs.size() / 2);
  EXPECT_TRUE(std::is_sorted(within.view.pair, within.view.pair + within.info.rows));

  q.max_results = 5;
  const Answer cut = evaluate(engine, q);
  EXPECT_EQ(cut.info.rows, 5u);
  EXPECT_EQ(cut.info.total, within.info.rows);
}

TEST_P(EngineTest, WithinAnswersPairsOfBadBodiesToo) {
  engine::Engine engine = make(mixed_scene(10, 20, 3));
  const BodyPose bad{2, {{std::nan(""), 0, 0}}};
  engine.set_poses({&bad, 1});
  QueryView q;
  q.fields = kAllFields;
  q.reduce = Reduce::kWithin;
  q.max_distance = 1e-3;
  const Answer within = evaluate(engine, q);
  std::uint64_t of_bad = 0;
  for (std::uint64_t i = 0; i < within.info.rows; ++i)
    of_bad += static_cast<Status>(within.view.status[i]) == Status::kBadPose;
  EXPECT_EQ(of_bad, 9u);
}

// A body without a usable pose may be nearer than all others: only an overlap of others is certain.
TEST_P(EngineTest, ReductionsDoNotPassOverMissingPoses) {
  engine::Scene scene;
  scene.add_box("robot", {0.2, 0.2, 0.2}, {.pose = Pose{}});
  scene.add_box("far", {0.1, 0.1, 0.1}, {.pose = Pose{{3, 0, 0}}});
  scene.add_sphere("person", 0.3, {});
  scene.add_sphere("other", 0.1, {.pose = Pose{{0, 4, 0}}});
  engine::Engine engine = make(std::move(scene));
  const auto expect_rows = [&](Status status) {
    for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest})
      for (const std::uint32_t fields : {kAllFields, std::uint32_t{kFieldStatus | kFieldLower}}) {
        QueryView q;
        q.fields = fields;
        q.reduce = reduce;
        q.max_distance = reduce == Reduce::kMin ? kInf : 1;
        const Answer a = evaluate(engine, q);
        ASSERT_EQ(a.info.rows, reduce == Reduce::kMin ? 1u : 4u);
        for (std::uint64_t i = 0; i < a.info.rows; ++i) {
          EXPECT_EQ(static_cast<Status>(a.view.status[i]), status) << i;
          EXPECT_EQ(a.view.lower[i], -kInf) << i;
          if (fields != kAllFields) continue;
          const BodyPair nearest[] = {{0, 2}, {1, 2}, {0, 2}, {2, 3}};
          EXPECT_EQ(a.view.pair[i], nearest[i]) << i;
          EXPECT_EQ(a.view.upper[i], kInf) << i;
          EXPECT_TRUE(std::isnan(a.view.distance[i])) << i;
          EXPECT_TRUE(a.view.flags[i] & kFlagIncomplete) << i;
        }
      }
  };
  expect_rows(Status::kNoPose);
  engine.set_poses(std::vector<BodyPose>{{2, Pose{{std::nan(""), 0, 1}}}});
  expect_rows(Status::kBadPose);

  engine.set_poses(std::vector<BodyPose>{{1, Pose{{0.1, 0, 0}}}});
  QueryView q;
  q.fields = kAllFields;
  for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest})
    for (const bool is_signed : {false, true}) {
      q.reduce = reduce;
      q.signed_distance = is_signed;
      const Answer a = evaluate(engine, q);
      for (std::uint64_t i = 0; i < a.info.rows; ++i) {
        const bool overlaps = i < 2;
        EXPECT_EQ(static_cast<Status>(a.view.status[i]), overlaps ? Status::kOverlap : Status::kBadPose) << i;
        EXPECT_TRUE(a.view.flags[i] & kFlagIncomplete) << i;
        if (overlaps) {
          EXPECT_EQ(a.view.pair[i], (BodyPair{0, 1}));
          EXPECT_EQ(a.view.lower[i], is_signed ? -kInf : 0) << "the person may be deeper inside";
        }
      }
    }
}

TEST_P(EngineTest, ReductionsOfManyPairsGoStageByStage) {
  // More pairs than one unit takes, so that stages are spread over threads and sliced.
  engine::Scene scene;
  Random random(2);
  for (int i = 0; i < 220; ++i) scene.add_sphere("s" + std::to_string(i), 0.3, {.pose = random.pose(8)});
  const engine::Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  const Answer dense = evaluate(engine, q);
  ASSERT_GT(dense.info.rows, 16384u);
  for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin, Reduce::kWithin}) {
    q.reduce = reduce;
    q.max_distance = reduce == Reduce::kWithin ? 0.5 : kInf;
    const Answer sliced = evaluate(engine, q, std::chrono::microseconds(50)), whole = evaluate(engine, q);
    EXPECT_EQ(bits(sliced), bits(whole));
    ASSERT_GT(whole.info.rows, 0u);
  }
  q.reduce = Reduce::kMin;
  const Answer min = evaluate(engine, q);
  EXPECT_EQ(min.view.upper[0], *std::min_element(dense.view.upper, dense.view.upper + dense.info.rows));
}

}  // namespace
}  // namespace clearance::test
