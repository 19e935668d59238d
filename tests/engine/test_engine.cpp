// Answers of the engine as a whole: distances, depths, statuses, columns, configurations, groups.
#include <algorithm>
#include <cmath>
#include <map>

#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

INSTANTIATE_TEST_SUITE_P(Backends, EngineTest, ::testing::ValuesIn(engine::Engine::backends()),
                         [](const auto& backend) { return backend.param; });

TEST_P(EngineTest, TwoUnitBoxesAreAsFarApartAsTheyLook) {
  engine::Scene scene;
  scene.add_box("a", {1, 1, 1}, {.pose = Pose{}});
  scene.add_box("b", {1, 1, 1}, {.pose = Pose{{3, 0, 0}}});
  const engine::Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  const Answer r = evaluate(engine, q);
  ASSERT_EQ(r.size.rows, 1u);
  EXPECT_EQ(static_cast<Status>(r.view.status[0]), Status::kOk);
  EXPECT_LE(r.view.lower[0], 2.0);
  EXPECT_GE(r.view.upper[0], 2.0);
  EXPECT_NEAR(r.view.distance[0], 2.0, 1e-12);
  EXPECT_NEAR(r.view.point_a[0], 0.5, 1e-12);
  EXPECT_NEAR(r.view.point_b[0], 2.5, 1e-12);
  EXPECT_NEAR(r.view.normal[0], 1.0, 1e-12);
  EXPECT_TRUE(r.view.flags[0] & kFlagNonsmooth) << "facing faces have no unique nearest points";
  EXPECT_NEAR(r.view.gradient[3], -1.0, 1e-12);
  EXPECT_NEAR(r.view.gradient[9], 1.0, 1e-12);
}

TEST_P(EngineTest, SignedOverlapIsTheLeastTranslationApart) {
  engine::Scene scene;
  scene.add_box("a", {2, 2, 2}, {.pose = Pose{}});
  scene.add_box("b", {2, 2, 2}, {.pose = Pose{{1.75, 0.5, 0}}});
  const engine::Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  q.signed_distance = true;
  const Answer deep = evaluate(engine, q);
  EXPECT_EQ(static_cast<Status>(deep.view.status[0]), Status::kOverlap);
  EXPECT_LE(deep.view.lower[0], -0.25);
  EXPECT_GE(deep.view.upper[0], -0.25);
  EXPECT_NEAR(deep.view.distance[0], -0.25, 1e-12);
  EXPECT_NEAR(deep.view.normal[0], 1.0, 1e-12);
  q.signed_distance = false;
  const Answer clipped = evaluate(engine, q);
  EXPECT_EQ(static_cast<Status>(clipped.view.status[0]), Status::kOverlap);
  EXPECT_EQ(clipped.view.lower[0], 0.0);
  EXPECT_EQ(clipped.view.upper[0], 0.0);
}

TEST_P(EngineTest, TouchingBoxesAreInContact) {
  engine::Scene scene;
  scene.add_box("a", {1, 1, 1}, {.pose = Pose{}});
  scene.add_box("b", {1, 1, 1}, {.pose = Pose{{1, 0.25, 0}}});
  const engine::Engine engine = make(std::move(scene));
  const Answer r = evaluate(engine, {});
  EXPECT_EQ(static_cast<Status>(r.view.status[0]), Status::kContact);
  EXPECT_LE(r.view.lower[0], 0.0);
  EXPECT_GE(r.view.upper[0], 0.0);
  EXPECT_LT(r.view.upper[0], 1e-14);
}

TEST_P(EngineTest, BadMissingAndUnknownBodiesSpoilOnlyTheirOwnRows) {
  engine::Scene scene;
  scene.add_sphere("a", 0.5, {.pose = Pose{}});
  scene.add_sphere("b", 0.5, {.pose = Pose{{2, 0, 0}}});
  scene.add_sphere("never", 0.5, {});
  scene.add_sphere("bad", 0.5, {.pose = Pose{{4, 0, 0}}});
  engine::Engine engine = make(std::move(scene));
  const BodyPose nan_pose{3, {{std::nan(""), 0, 0}}};
  const PoseUpdateResult update = engine.set_poses({&nan_pose, 1});
  EXPECT_EQ(update.bad, 1u);
  const BodyPair pairs[] = {{0, 1}, {0, 2}, {0, 3}, {0, 17}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.fields = kAllFields;
  const Answer r = evaluate(engine, q);
  const Status expected[] = {Status::kOk, Status::kNoPose, Status::kBadPose, Status::kUnknownBody};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(static_cast<Status>(r.view.status[i]), expected[i]) << i;
  EXPECT_NEAR(r.view.distance[0], 1.0, 1e-12);
  EXPECT_TRUE(std::isnan(r.view.distance[3]));
  EXPECT_EQ(r.view.lower[1], -kInf);
  EXPECT_EQ(r.view.upper[1], kInf);
}

TEST_P(EngineTest, BitsDoNotDependOnThreadsOrSlices) {
  const engine::Engine one = make(mixed_scene(40, 3, 11), 1), two = make(mixed_scene(40, 3, 11), 2);
  for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
    QueryView q;
    q.fields = kAllFields;
    q.reduce = reduce;
    if (reduce == Reduce::kWithin) q.max_distance = 1.5;
    const Answer whole = evaluate(one, q), parallel = evaluate(two, q),
                 sliced = evaluate(two, q, std::chrono::nanoseconds(1));
    ASSERT_GT(whole.info.rows, 0u);
    EXPECT_EQ(bits(whole), bits(parallel)) << int(reduce);
    EXPECT_EQ(bits(whole), bits(sliced)) << int(reduce);
  }
}

TEST_P(EngineTest, IntervalsAgreeWithTheReference) {
  const engine::Engine engine = make(mixed_scene(60, 2.5, 5));
  const engine::Engine reference(mixed_scene(60, 2.5, 5), {"reference", 2});
  for (const bool with_depth : {false, true}) {
    QueryView q;
    q.fields = kAllFields;
    q.signed_distance = with_depth;
    const Answer a = evaluate(engine, q), b = evaluate(reference, q);
    std::map<Status, int> seen;
    for (std::uint64_t i = 0; i < a.info.rows; ++i) {
      ASSERT_LE(std::max(a.view.lower[i], b.view.lower[i]), std::min(a.view.upper[i], b.view.upper[i])) << i;
      ASSERT_EQ(a.view.status[i], b.view.status[i]) << i;
      ++seen[static_cast<Status>(a.view.status[i])];
    }
    EXPECT_GT(seen[Status::kOk], 100);
    EXPECT_GT(seen[Status::kOverlap], 10);
  }
}

TEST_P(EngineTest, BeyondPairsCarryALowerBoundAboveMaxDistance) {
  const engine::Engine engine = make(mixed_scene(60, 6, 9));
  QueryView q;
  q.fields = kAllFields;
  const Answer whole = evaluate(engine, q);
  q.max_distance = 3;
  const Answer cut = evaluate(engine, q);
  int beyond = 0;
  for (std::uint64_t i = 0; i < cut.info.rows; ++i) {
    EXPECT_LE(cut.view.lower[i], whole.view.upper[i]);
    EXPECT_GE(cut.view.upper[i], whole.view.lower[i]);
    if (static_cast<Status>(cut.view.status[i]) != Status::kBeyond) continue;
    ++beyond;
    EXPECT_GT(cut.view.lower[i], 3);
    EXPECT_EQ(cut.view.distance[i], cut.view.lower[i]);
    EXPECT_TRUE(std::isnan(cut.view.point_a[3 * i]));
  }
  EXPECT_GT(beyond, 100);
}

TEST_P(EngineTest, ConfigurationsAnswerAsIfThePosesHadBeenSet) {
  engine::Engine engine = make(mixed_scene(20, 3, 21));
  engine.attach(3, 1);  // body 3 follows body 1
  Random random(1);
  const std::uint32_t bodies[] = {1, 8};
  std::vector<Pose> configurations;
  for (int i = 0; i < 7 * 2; ++i) configurations.push_back(random.pose(3));
  QueryView q;
  q.bodies = bodies;
  q.configurations = configurations;
  q.configuration_count = 7;
  q.fields = kAllFields;
  const Answer batch = evaluate(engine, q);
  const std::vector<BodyPair> pairs = engine.pairs(q);
  EXPECT_EQ(batch.size.pairs, pairs.size());
  for (const BodyPair& p : pairs) EXPECT_TRUE(p.a == 1 || p.a == 3 || p.a == 8 || p.b == 1 || p.b == 3 || p.b == 8);
  for (int k = 0; k < 7; ++k) {
    const BodyPose update[] = {{1, configurations[2 * k]}, {8, configurations[2 * k + 1]}};
    engine.set_poses(update);
    QueryView one;
    one.all_pairs = false;
    one.pairs = pairs;
    one.fields = kAllFields;
    const Answer alone = evaluate(engine, one);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      ASSERT_EQ(alone.view.lower[i], batch.view.lower[k * pairs.size() + i]);
      ASSERT_EQ(alone.view.upper[i], batch.view.upper[k * pairs.size() + i]);
    }
  }
}

TEST_P(EngineTest, GradientPredictsSmallMotions) {
  engine::Engine engine = make(mixed_scene(24, 3, 77));
  QueryView q;
  q.fields = kAllFields;
  q.rel_tol = 1e-12;
  q.signed_distance = true;
  const Answer before = evaluate(engine, q);
  const std::vector<BodyPair> pairs = engine.pairs(q);
  Random random(3);
  const double h = 1e-6;
  int smooth = 0;
  for (std::uint32_t body = 0; body < 24; ++body) {
    if (engine.scene().bodies()[body].is_static) continue;
    const Pose X = engine.body_state(body).X_wb;
    const Vec3d turn{random.normal(), random.normal(), random.normal()},
        move{random.normal(), random.normal(), random.normal()};
    const Pose spin = {{0, 0, 0}, 1, 0.5 * h * turn.x, 0.5 * h * turn.y, 0.5 * h * turn.z};
    Pose moved = compose(spin, {{0, 0, 0}, X.qw, X.qx, X.qy, X.qz});
    moved.translation = X.translation + h * move;
    const BodyPose update{body, moved};
    engine.set_poses({&update, 1});
    const Answer after = evaluate(engine, q);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (pairs[i].a != body && pairs[i].b != body) continue;
      if ((before.view.flags[i] & kFlagNonsmooth) || static_cast<Status>(before.view.status[i]) != Status::kOk)
        continue;
      const double* g = before.view.gradient + 12 * i + (pairs[i].a == body ? 0 : 6);
      const double predicted =
          h * (g[0] * turn.x + g[1] * turn.y + g[2] * turn.z + g[3] * move.x + g[4] * move.y + g[5] * move.z);
      EXPECT_NEAR(after.view.distance[i] - before.view.distance[i], predicted, 2e-10)
          << pairs[i].a << " " << pairs[i].b;
      ++smooth;
    }
    const BodyPose back{body, X};
    engine.set_poses({&back, 1});
  }
  EXPECT_GT(smooth, 100);
}

TEST_P(EngineTest, Float32BoundsHoldTheFullInterval) {
  const engine::Engine engine = make(mixed_scene(30, 3, 4));
  QueryView q;
  q.fields = kAllFields;
  const Answer full = evaluate(engine, q);
  q.fields = kFloat32;
  const Answer rounded = evaluate(engine, q);
  ASSERT_GT(full.info.rows, 400u);
  for (std::uint64_t i = 0; i < full.info.rows; ++i) {
    const float lower = rounded.view.bounds[2 * i], upper = rounded.view.bounds[2 * i + 1];
    EXPECT_LE(lower, full.view.lower[i]);
    EXPECT_GE(upper, full.view.upper[i]);
    EXPECT_GT(std::nextafter(lower, INFINITY), full.view.lower[i]) << "no float fits closer";
    EXPECT_LT(std::nextafter(upper, -INFINITY), full.view.upper[i]) << "no float fits closer";
  }
}

// A million metres from the world's origin, where a float32 is 6 cm wide.
TEST_P(EngineTest, Float32PointsKeepTheirPrecisionFarFromTheOrigin) {
  const double far = 1e6;
  engine::Scene scene;
  scene.add_box("a", {1, 1, 1}, {.pose = Pose{{far, far, far}}});
  scene.add_box("b", {1, 1, 1}, {.pose = Pose{{far + 1.25, far, far}, 0.98, 0.1, 0.1, 0.14}});
  const engine::Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kFieldPoints | kFieldPoints32;
  const Answer answer = evaluate(engine, q);
  ASSERT_EQ(answer.info.rows, 1u);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(answer.view.points32[k], answer.view.point_a[k] - far, 1e-7);
    EXPECT_NEAR(answer.view.points32[3 + k], answer.view.point_b[k] - (k == 0 ? far + 1.25 : far), 1e-7);
  }
}

TEST_P(EngineTest, GroupPairsExpandToTheirEnabledPairs) {
  engine::Scene scene = mixed_scene(12, 3, 8);
  const std::string arm[] = {"body0", "body1", "body2"};
  scene.add_group("arm", arm);
  scene.ignore("arm", "arm");
  const engine::Engine engine = make(std::move(scene));
  const BodyPair selectors[] = {{kGroupBit | 0, kEveryBody}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = selectors;
  const std::vector<BodyPair> pairs = engine.pairs(q);
  EXPECT_EQ(pairs.size(), 3u * 9u);
  EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end()));
}

}  // namespace
}  // namespace clearance::test
