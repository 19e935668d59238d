// The engine as a whole: answers, reductions, slices, snapshots, attachments, each against brute force.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <set>

#include "engine_test_util.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

class EngineTest : public ::testing::TestWithParam<std::string> {
 protected:
  Engine make(Scene scene, int threads = 2) { return Engine(std::move(scene), {GetParam(), threads}); }
};
INSTANTIATE_TEST_SUITE_P(Backends, EngineTest, ::testing::ValuesIn(Engine::backends()),
                         [](const auto& backend) { return backend.param; });

TEST_P(EngineTest, TwoUnitBoxesAreAsFarApartAsTheyLook) {
  Scene scene;
  scene.add_box("a", {1, 1, 1}, {.pose = Pose{}});
  scene.add_box("b", {1, 1, 1}, {.pose = Pose{{3, 0, 0}}});
  const Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  const Answer r = ask(engine, q);
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
  Scene scene;
  scene.add_box("a", {2, 2, 2}, {.pose = Pose{}});
  scene.add_box("b", {2, 2, 2}, {.pose = Pose{{1.75, 0.5, 0}}});
  const Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  q.signed_distance = true;
  const Answer deep = ask(engine, q);
  EXPECT_EQ(static_cast<Status>(deep.view.status[0]), Status::kOverlap);
  EXPECT_LE(deep.view.lower[0], -0.25);
  EXPECT_GE(deep.view.upper[0], -0.25);
  EXPECT_NEAR(deep.view.distance[0], -0.25, 1e-12);
  EXPECT_NEAR(deep.view.normal[0], 1.0, 1e-12);
  q.signed_distance = false;
  const Answer clipped = ask(engine, q);
  EXPECT_EQ(static_cast<Status>(clipped.view.status[0]), Status::kOverlap);
  EXPECT_EQ(clipped.view.lower[0], 0.0);
  EXPECT_EQ(clipped.view.upper[0], 0.0);
}

TEST_P(EngineTest, TouchingBoxesAreInContact) {
  Scene scene;
  scene.add_box("a", {1, 1, 1}, {.pose = Pose{}});
  scene.add_box("b", {1, 1, 1}, {.pose = Pose{{1, 0.25, 0}}});
  const Engine engine = make(std::move(scene));
  const Answer r = ask(engine, {});
  EXPECT_EQ(static_cast<Status>(r.view.status[0]), Status::kContact);
  EXPECT_LE(r.view.lower[0], 0.0);
  EXPECT_GE(r.view.upper[0], 0.0);
  EXPECT_LT(r.view.upper[0], 1e-14);
}

TEST_P(EngineTest, BadMissingAndUnknownBodiesSpoilOnlyTheirOwnRows) {
  Scene scene;
  scene.add_sphere("a", 0.5, {.pose = Pose{}});
  scene.add_sphere("b", 0.5, {.pose = Pose{{2, 0, 0}}});
  scene.add_sphere("never", 0.5, {});
  scene.add_sphere("bad", 0.5, {.pose = Pose{{4, 0, 0}}});
  Engine engine = make(std::move(scene));
  const BodyPose nan_pose{3, {{std::nan(""), 0, 0}}};
  const PoseUpdateResult update = engine.set_poses({&nan_pose, 1});
  EXPECT_EQ(update.bad, 1u);
  const BodyPair pairs[] = {{0, 1}, {0, 2}, {0, 3}, {0, 17}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.fields = kAllFields;
  const Answer r = ask(engine, q);
  const Status expected[] = {Status::kOk, Status::kNoPose, Status::kBadPose, Status::kUnknownBody};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(static_cast<Status>(r.view.status[i]), expected[i]) << i;
  EXPECT_NEAR(r.view.distance[0], 1.0, 1e-12);
  EXPECT_TRUE(std::isnan(r.view.distance[3]));
  EXPECT_EQ(r.view.lower[1], -kInf);
  EXPECT_EQ(r.view.upper[1], kInf);
}

// The whole of an answer, bit for bit.
std::vector<std::byte> bits(const Answer& a) {
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, a.size.rows, a.size.fields, &bytes);
  std::vector<std::byte> all;
  const auto append = [&](const void* p, std::size_t n) {
    const auto* b = static_cast<const std::byte*>(p);
    all.insert(all.end(), b, b + n);
  };
  append(a.view.distance, 8 * a.info.rows);
  append(a.view.lower, 8 * a.info.rows);
  append(a.view.upper, 8 * a.info.rows);
  append(a.view.status, a.info.rows);
  append(a.view.flags, 2 * a.info.rows);
  return all;
}

TEST_P(EngineTest, BitsDoNotDependOnThreadsOrSlices) {
  const Engine one = make(mixed_scene(40, 3, 11), 1), two = make(mixed_scene(40, 3, 11), 2);
  for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
    QueryView q;
    q.fields = kAllFields;
    q.reduce = reduce;
    if (reduce == Reduce::kWithin) q.max_distance = 1.5;
    const Answer whole = ask(one, q), parallel = ask(two, q), sliced = ask(two, q, std::chrono::nanoseconds(1));
    ASSERT_GT(whole.info.rows, 0u);
    EXPECT_EQ(bits(whole), bits(parallel)) << int(reduce);
    EXPECT_EQ(bits(whole), bits(sliced)) << int(reduce);
  }
}

TEST_P(EngineTest, IntervalsAgreeWithTheReference) {
  const Engine engine = make(mixed_scene(60, 2.5, 5));
  const Engine reference(mixed_scene(60, 2.5, 5), {"reference", 2});
  for (const bool with_depth : {false, true}) {
    QueryView q;
    q.fields = kAllFields;
    q.signed_distance = with_depth;
    const Answer a = ask(engine, q), b = ask(reference, q);
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

TEST_P(EngineTest, NearestAndMinAgreeWithAllPairs) {
  const Engine engine = make(mixed_scene(60, 4, 3));
  QueryView all;
  all.fields = kAllFields;
  const Answer dense = ask(engine, all);
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
  const Answer nearest = ask(engine, q);
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
  const Answer min = ask(engine, q);
  ASSERT_EQ(min.info.rows, 1u);
  EXPECT_EQ(min.view.upper[0], *std::min_element(least_upper.begin(), least_upper.end()));
  EXPECT_EQ(min.view.lower[0], *std::min_element(least_lower.begin(), least_lower.end()));
}

// Of body g: the rod has the nearest box and is far; h is beyond max_distance, and g is its nearest; y is nearer than h, and
// has a nearer neighbour than g itself.
TEST_P(EngineTest, NearestHoldsPairsThatAreBeyondAndNobodysNearestBoxes) {
  Scene scene;
  const double c = std::sqrt(0.5), s = std::sin(std::atan(1) / 2);
  scene.add_sphere("g", 0.1, {.pose = Pose{}});
  scene.add_box("rod", {2, 0.02, 0.02}, {.pose = Pose{{0.75, 0.75, 0}, std::sqrt(1 - s * s), 0, 0, -s}});
  scene.add_sphere("h", 0.1, {.pose = Pose{{-0.7, 0, 0}}});
  scene.add_sphere("y", 0.1, {.pose = Pose{{0, -0.65, 0}}});
  scene.add_sphere("z", 0.1, {.pose = Pose{{0, -0.9, 0}}});
  const Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  const Answer dense = ask(engine, q);
  ASSERT_NEAR(dense.view.distance[0], 1.5 * c - 0.1 - 0.01, 0.02) << "g and the rod";
  q.reduce = Reduce::kNearest;
  q.max_distance = 0.3;
  const Answer nearest = ask(engine, q);
  EXPECT_EQ(static_cast<Status>(nearest.view.status[0]), Status::kBeyond);
  EXPECT_LE(nearest.view.lower[0], 0.45 + 1e-12) << "y";
  EXPECT_GT(nearest.view.lower[0], 0.3);
}

// Boxes that touch say nothing about which of two overlaps is the deeper one.
TEST_P(EngineTest, NearestAndMinFindTheDeepestOverlap) {
  const Engine engine = make(mixed_scene(40, 1, 6));
  QueryView q;
  q.fields = kAllFields;
  q.signed_distance = true;
  const Answer dense = ask(engine, q);
  const std::vector<BodyPair> pairs = engine.pairs(q);
  std::vector<double> least(40, kInf);
  int overlaps = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    overlaps += dense.view.upper[i] < 0;
    for (const std::uint32_t body : {pairs[i].a, pairs[i].b}) least[body] = std::min(least[body], dense.view.upper[i]);
  }
  ASSERT_GT(overlaps, 100);
  q.reduce = Reduce::kNearest;
  const Answer nearest = ask(engine, q);
  for (std::uint32_t body = 0; body < 40; ++body) EXPECT_EQ(nearest.view.upper[body], least[body]) << body;
  q.reduce = Reduce::kMin;
  EXPECT_EQ(ask(engine, q).view.upper[0], *std::min_element(least.begin(), least.end()));
}

TEST_P(EngineTest, WithinKeepsExactlyThePairsNotProvedFarther) {
  const Engine engine = make(mixed_scene(60, 4, 3));
  QueryView all;
  all.fields = kAllFields;
  const Answer dense = ask(engine, all);
  const std::vector<BodyPair> pairs = engine.pairs(all);
  QueryView q = all;
  q.reduce = Reduce::kWithin;
  q.max_distance = 2;
  const Answer within = ask(engine, q);
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
  const Answer cut = ask(engine, q);
  EXPECT_EQ(cut.info.rows, 5u);
  EXPECT_EQ(cut.info.total, within.info.rows);
}

TEST_P(EngineTest, WithinAnswersPairsOfBadBodiesToo) {
  Engine engine = make(mixed_scene(10, 20, 3));
  const BodyPose bad{2, {{std::nan(""), 0, 0}}};
  engine.set_poses({&bad, 1});
  QueryView q;
  q.fields = kAllFields;
  q.reduce = Reduce::kWithin;
  q.max_distance = 1e-3;
  const Answer within = ask(engine, q);
  std::uint64_t of_bad = 0;
  for (std::uint64_t i = 0; i < within.info.rows; ++i)
    of_bad += static_cast<Status>(within.view.status[i]) == Status::kBadPose;
  EXPECT_EQ(of_bad, 9u);
  q.reduce = Reduce::kNearest;
  const Answer nearest = ask(engine, q);
  EXPECT_EQ(static_cast<Status>(nearest.view.status[2]), Status::kBadPose);
  for (int b = 0; b < 10; ++b) {
    if (b != 2) {
      EXPECT_TRUE(nearest.view.flags[b] & kFlagIncomplete) << b;
    }
  }
}

TEST_P(EngineTest, BeyondPairsCarryALowerBoundAboveMaxDistance) {
  const Engine engine = make(mixed_scene(60, 6, 9));
  QueryView q;
  q.fields = kAllFields;
  const Answer whole = ask(engine, q);
  q.max_distance = 3;
  const Answer cut = ask(engine, q);
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
  Engine engine = make(mixed_scene(20, 3, 21));
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
  const Answer batch = ask(engine, q);
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
    const Answer alone = ask(engine, one);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      ASSERT_EQ(alone.view.lower[i], batch.view.lower[k * pairs.size() + i]);
      ASSERT_EQ(alone.view.upper[i], batch.view.upper[k * pairs.size() + i]);
    }
  }
}

TEST_P(EngineTest, GradientPredictsSmallMotions) {
  Engine engine = make(mixed_scene(24, 3, 77));
  QueryView q;
  q.fields = kAllFields;
  q.rel_tol = 1e-12;
  q.signed_distance = true;
  const Answer before = ask(engine, q);
  const std::vector<BodyPair> pairs = engine.pairs(q);
  Random random(3);
  const double h = 1e-6;
  int smooth = 0;
  for (std::uint32_t body = 0; body < 24; ++body) {
    if (engine.scene().bodies()[body].is_static) continue;
    const Pose X = engine.body_state(body).X_wb;
    const Vec3d turn{random.normal(), random.normal(), random.normal()}, move{random.normal(), random.normal(), random.normal()};
    const Pose spin = {{0, 0, 0}, 1, 0.5 * h * turn.x, 0.5 * h * turn.y, 0.5 * h * turn.z};
    Pose moved = compose(spin, {{0, 0, 0}, X.qw, X.qx, X.qy, X.qz});
    moved.translation = X.translation + h * move;
    const BodyPose update{body, moved};
    engine.set_poses({&update, 1});
    const Answer after = ask(engine, q);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (pairs[i].a != body && pairs[i].b != body) continue;
      if ((before.view.flags[i] & kFlagNonsmooth) || static_cast<Status>(before.view.status[i]) != Status::kOk) continue;
      const double* g = before.view.gradient + 12 * i + (pairs[i].a == body ? 0 : 6);
      const double predicted = h * (g[0] * turn.x + g[1] * turn.y + g[2] * turn.z + g[3] * move.x + g[4] * move.y + g[5] * move.z);
      EXPECT_NEAR(after.view.distance[i] - before.view.distance[i], predicted, 2e-10) << pairs[i].a << " " << pairs[i].b;
      ++smooth;
    }
    const BodyPose back{body, X};
    engine.set_poses({&back, 1});
  }
  EXPECT_GT(smooth, 100);
}

TEST_P(EngineTest, CompactRowsHoldTheFullInterval) {
  const Engine engine = make(mixed_scene(30, 3, 4));
  QueryView q;
  q.fields = kAllFields;
  const Answer full = ask(engine, q);
  q.format = Format::kCompact;
  q.fields = kFieldStatus;
  const Answer compact = ask(engine, q);
  EXPECT_EQ(compact.size.fields, kFieldStatus | kFieldCompact);
  for (std::uint64_t i = 0; i < full.info.rows; ++i) {
    EXPECT_LE(compact.view.compact[i].lower, full.view.lower[i]);
    EXPECT_GE(compact.view.compact[i].upper, full.view.upper[i]);
  }
}

TEST_P(EngineTest, GroupPairsExpandToTheirEnabledPairs) {
  Scene scene = mixed_scene(12, 3, 8);
  const std::string arm[] = {"body0", "body1", "body2"};
  scene.add_group("arm", arm);
  scene.ignore("arm", "arm");
  const Engine engine = make(std::move(scene));
  const BodyPair selectors[] = {{kGroupBit | 0, kEveryBody}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = selectors;
  const std::vector<BodyPair> pairs = engine.pairs(q);
  EXPECT_EQ(pairs.size(), 3u * 9u);
  EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end()));
}

TEST_P(EngineTest, GroupsThatNameMorePairsThanMemoryHoldsAreRefused) {
  Scene scene;
  std::vector<std::string> fixed;
  for (int i = 0; i < 300; ++i) {
    scene.add_sphere("s" + std::to_string(i), 0.1, {.is_static = i >= 100, .pose = Pose{{1.0 * i, 0, 0}}});
    if (i >= 100) fixed.push_back("s" + std::to_string(i));
  }
  scene.add_group("fixed", fixed);
  const Engine engine = make(std::move(scene));
  QueryView q;
  const std::vector<BodyPair> all = engine.pairs(q);
  q.all_pairs = false;
  const auto ask_for = [&](BodyPair selector, std::size_t times) {
    const std::vector<BodyPair> selectors(times, selector);
    q.pairs = selectors;
    return engine.pairs(q);
  };
  EXPECT_EQ(ask_for({kEveryBody, kEveryBody}, 1), all);
  EXPECT_EQ(ask_for({kEveryBody, kEveryBody}, 3).size(), 3 * all.size());
  EXPECT_TRUE(ask_for({kGroupBit, kGroupBit}, 20).empty());
  // 0.4 and 0.8 MB of selectors would be 35 GB of pairs, and hours of looking for pairs that are none.
  for (const auto& [selector, times] : {std::pair{BodyPair{kEveryBody, kEveryBody}, 50'000}, {BodyPair{kGroupBit, kGroupBit}, 100'000}}) try {
      ask_for(selector, static_cast<std::size_t>(times));
      FAIL();
    } catch (const QueryError& error) {
      EXPECT_EQ(error.code, QueryErrorCode::kTooLarge);
      EXPECT_NE(std::string(error.what()).find("more than the 33554432 of one query"), std::string::npos) << error.what();
    }
}

TEST_P(EngineTest, ReductionsOfManyPairsGoStageByStage) {
  // More pairs than one unit takes, so that stages are spread over threads and sliced.
  Scene scene;
  Random random(2);
  for (int i = 0; i < 220; ++i) scene.add_sphere("s" + std::to_string(i), 0.3, {.pose = random.pose(8)});
  const Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  const Answer dense = ask(engine, q);
  ASSERT_GT(dense.info.rows, 16384u);
  for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin, Reduce::kWithin}) {
    q.reduce = reduce;
    q.max_distance = reduce == Reduce::kWithin ? 0.5 : kInf;
    const Answer sliced = ask(engine, q, std::chrono::microseconds(50)), whole = ask(engine, q);
    EXPECT_EQ(bits(sliced), bits(whole));
    ASSERT_GT(whole.info.rows, 0u);
  }
  q.reduce = Reduce::kMin;
  const Answer min = ask(engine, q);
  EXPECT_EQ(min.view.upper[0], *std::min_element(dense.view.upper, dense.view.upper + dense.info.rows));
}

TEST_P(EngineTest, AttachedBodiesFollowAndLeaveThePairTable) {
  Scene scene;
  scene.add_box("hand", {0.2, 0.2, 0.2}, {.pose = Pose{}});
  scene.add_box("cup", {0.1, 0.1, 0.1}, {.pose = Pose{{0.5, 0, 0}}});
  scene.add_box("wall", {1, 1, 1}, {.is_static = true, .pose = Pose{{5, 0, 0}}});
  Engine engine = make(std::move(scene));
  const std::uint64_t free_revision = engine.scene_revision();
  EXPECT_EQ(engine.pairs({}).size(), 3u);
  engine.attach(1, 0);
  EXPECT_NE(engine.scene_revision(), free_revision);
  EXPECT_EQ(engine.pairs({}).size(), 2u);
  const BodyPose update{0, {{0, 1, 0}}};
  engine.set_poses({&update, 1});
  EXPECT_NEAR(engine.body_state(1).X_wb.translation.x, 0.5, 1e-15);
  EXPECT_NEAR(engine.body_state(1).X_wb.translation.y, 1.0, 1e-15);
  EXPECT_THROW(engine.attach(0, 1), QueryError) << "a cycle";
  EXPECT_THROW(engine.attach(2, 0), QueryError) << "a static child";
  engine.attach(1, kNone);
  EXPECT_EQ(engine.scene_revision(), free_revision);
  EXPECT_NEAR(engine.body_state(1).X_wb.translation.y, 1.0, 1e-15);
}

TEST_P(EngineTest, JobsKeepTheSnapshotTheyBeganWith) {
  Scene scene;
  scene.add_sphere("a", 0.5, {.pose = Pose{}});
  scene.add_sphere("b", 0.5, {.pose = Pose{{3, 0, 0}}});
  Engine engine = make(std::move(scene));
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
  EXPECT_EQ(ask(engine, q).info.snapshot_stamp_ns, 42);
}

TEST_P(EngineTest, StalePosesAreFlagged) {
  Scene scene;
  scene.add_sphere("a", 0.5, {.pose = Pose{}});
  scene.add_sphere("wall", 0.5, {.is_static = true, .pose = Pose{{3, 0, 0}}});
  Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  EXPECT_FALSE(ask(engine, q).view.flags[0] & kFlagStale) << "no limit was asked for";
  q.max_pose_age_ns = 3'600'000'000'000;
  EXPECT_TRUE(ask(engine, q).view.flags[0] & kFlagStale) << "no pose was ever received";
  const BodyPose update{0, {}};
  engine.set_poses({&update, 1});
  EXPECT_FALSE(ask(engine, q).view.flags[0] & kFlagStale);
  q.max_pose_age_ns = 1;
  EXPECT_TRUE(ask(engine, q).view.flags[0] & kFlagStale);
}

TEST_P(EngineTest, TheAgeOfPosesIsWhatStaleGoesBy) {
  Scene scene;
  for (const char* name : {"a", "b", "c"}) scene.add_sphere(name, 0.1, {.pose = Pose{}});
  Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kDefaultFields | kFieldFlags;
  const std::vector<BodyPair> pairs{{0, 1}, {1, 2}};
  q.pairs = pairs;
  q.all_pairs = false;
  EXPECT_EQ(ask(engine, q).info.pose_age_ns, -1) << "none was received";
  for (std::uint32_t body = 0; body < 3; ++body) {
    const BodyPose update{body, {{1.0 * body, 0, 0}}};
    engine.set_poses({&update, 1}, 10 * body, body + 1);
  }
  int stale = 0, young = 0;
  for (int i = 0; i < 400; ++i) {
    const Answer plain = ask(engine, q);
    EXPECT_EQ(plain.info.snapshot_sequence, 3);
    EXPECT_GE(plain.info.pose_age_ns, 0);
    QueryView limited = q;
const std::int64_t off = std::int64_t{1} << i % 40;  // from what will have passed by then to far more
    limited.max_pose_age_ns = std::max<std::int64_t>(plain.info.pose_age_ns + (i % 2 ? off : -off), 1);
    const Answer answer = ask(engine, limited);
    const bool too_old = answer.info.pose_age_ns > limited.max_pose_age_ns;
    EXPECT_EQ((answer.view.flags[0] & kFlagStale) != 0, too_old) << "body 0 has the oldest pose";
    if (!too_old) {
      EXPECT_FALSE(answer.view.flags[1] & kFlagStale);
    }
    ++(too_old ? stale : young);
  }
  EXPECT_GT(stale, 0);
  EXPECT_GT(young, 0);
}

struct BadQuery {
  const char* text;
  void (*spoil)(QueryView&);
};

TEST_P(EngineTest, BadQueriesNameTheirFault) {
  static const std::uint32_t kTwice[] = {0, 0}, kFar[] = {9}, kStatic[] = {4};
  static const BodyPair kSelf[] = {{1, 1}}, kGroup[] = {{kGroupBit | 7, 0}};
  static const Pose kOne[1];
  const BadQuery cases[] = {
      {"max_distance: expected metres >= 0, got nan", [](QueryView& q) { q.max_distance = std::nan(""); }},
      {"max_distance: expected metres >= 0, got -1", [](QueryView& q) { q.max_distance = -1; }},
      {"abs_tol: expected metres >= 0", [](QueryView& q) { q.abs_tol = -1; }},
      {"rel_tol: expected a ratio below 1", [](QueryView& q) { q.rel_tol = 1; }},
      {"fields: unknown bits", [](QueryView& q) { q.fields = 1u << 20; }},
      {"reduce: unknown value 9", [](QueryView& q) { q.reduce = static_cast<Reduce>(9); }},
      {"bodies[1]: 'body0' is named twice", [](QueryView& q) { q.bodies = kTwice; }},
      {"bodies[0]: unknown body 9", [](QueryView& q) { q.bodies = kFar; }},
      {"bodies[0]: 'body4' is static", [](QueryView& q) { q.bodies = kStatic; }},
      {"pairs[0]: body 1 with itself", [](QueryView& q) { q.all_pairs = false; q.pairs = kSelf; }},
      {"pairs[0]: unknown group 7", [](QueryView& q) { q.all_pairs = false; q.pairs = kGroup; }},
      {"configurations without bodies", [](QueryView& q) { q.configuration_count = 1; }},
      {"expected 3 poses (3 x 1), got 1",
       [](QueryView& q) { static const std::uint32_t b[] = {0}; q.bodies = b; q.configuration_count = 3; q.configurations = kOne; }},
      {"the scene is revision", [](QueryView& q) { q.scene_revision = 12345; }},
  };
  const Engine engine = make(mixed_scene(6, 3, 8));
  for (const BadQuery& c : cases) {
    QueryView q;
    c.spoil(q);
    try {
      ReplyView none;
      engine.start(q, none);
      ADD_FAILURE() << "accepted: " << c.text;
    } catch (const QueryError& e) {
      EXPECT_NE(std::string(e.what()).find(c.text), std::string::npos) << e.what();
    }
    EXPECT_EQ(ask(engine, {}).info.rows, engine.pairs({}).size()) << "a good query after: " << c.text;
  }
}

TEST_P(EngineTest, AbsurdSizesAreRefusedBeforeAnythingIsAllocated) {
  static const std::uint32_t kBody[] = {0};
  const Engine engine = make(mixed_scene(6, 3, 8));
  QueryView q;
  q.bodies = kBody;
  q.configuration_count = 0xFFFFFFFF;
  try {
    engine.size(q);
    FAIL() << "accepted";
  } catch (const QueryError& e) {
    EXPECT_EQ(e.code, QueryErrorCode::kTooLarge);
    EXPECT_NE(std::string(e.what()).find("4294967295 configurations x 5 rows are more than the limit"), std::string::npos) << e.what();
  }
}

TEST_P(EngineTest, AnAnswerLargerThanItsRoomIsRefused) {
  Engine engine = make(mixed_scene(6, 3, 8));
  double lower[4];
  ReplyView room;
  room.rows = 4;
  room.lower = lower;
  EXPECT_THROW(engine.start({}, room), QueryError);
}

TEST(Engine, UnknownBackendsAreRefusedByName) {
  EXPECT_THROW(Engine(mixed_scene(4, 3, 1), {"gpu"}), std::invalid_argument);
  const std::vector<std::string> there = Engine::backends();
  if (std::find(there.begin(), there.end(), "cuda") == there.end()) {
    EXPECT_THROW(Engine(mixed_scene(4, 3, 1), {"cuda"}), std::runtime_error);
  }
  const bool has_device = std::find(there.begin(), there.end(), "cuda") != there.end();
  EXPECT_EQ(Engine(mixed_scene(4, 3, 1)).backend(), has_device ? "auto" : "cpu");
  EXPECT_THROW(Engine(mixed_scene(4, 3, 1), {.calibration = "often"}), std::invalid_argument);
}

}  // namespace
}  // namespace clearance::test
