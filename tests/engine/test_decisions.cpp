// Reduce::kAny: decisions of whole configurations, compared with all pairs.
#include <algorithm>
#include <cmath>

#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

bool is_within(std::uint8_t status) {
  return status <= std::uint8_t(Status::kContact);
}

// K configurations of three bodies of a scene, some of them far from everything.
struct Moved {
  std::vector<std::uint32_t> bodies{1, 2, 3};
  std::vector<Pose> poses;
  QueryView query;

  explicit Moved(int configurations) {
    Random random(6);
    for (int i = 0; i < configurations * 3; ++i) poses.push_back(random.pose(i < 2 * configurations ? 1.6 : 60));
    query.fields = kAllFields;
    query.bodies = bodies;
    query.configurations = poses;
    query.configuration_count = static_cast<std::uint32_t>(configurations);
  }
};

// Expected result of each row, from all pairs' intervals.
void expect_agrees(const Answer& any, const Answer& dense, std::span<const BodyPair> pairs,
                   std::span<const double> margins) {
  const std::size_t configurations = dense.info.rows / pairs.size();
  ASSERT_EQ(any.info.rows, configurations);
  int beyond = 0, within = 0;
  for (std::size_t k = 0; k < configurations; ++k) {
    const double *lower = dense.view.lower + k * pairs.size(), *upper = dense.view.upper + k * pairs.size();
    const std::uint8_t status = any.view.status[k];
    std::size_t first = 0;
    while (first < pairs.size() && !(upper[first] <= margins[first])) ++first;
    if (is_within(status)) {
      ++within;
      ASSERT_LT(first, pairs.size()) << k;
      EXPECT_EQ(any.view.pair[k], pairs[first]) << k << ": not the first within its margin";
      EXPECT_LE(any.view.upper[k], margins[first]) << k;
      EXPECT_LE(any.view.lower[k], upper[first]) << k;
      EXPECT_GE(any.view.upper[k], lower[first]) << k;
      const double far = norm(Vec3d{any.view.point_b[3 * k], any.view.point_b[3 * k + 1], any.view.point_b[3 * k + 2]} -
                              Vec3d{any.view.point_a[3 * k], any.view.point_a[3 * k + 1], any.view.point_a[3 * k + 2]});
      EXPECT_LE(far, any.view.upper[k] + 1e-9) << k << ": its points are farther apart";
    } else {
      EXPECT_EQ(status, std::uint8_t(Status::kBeyond)) << k;
      ++beyond;
      EXPECT_EQ(first, pairs.size()) << k;
      for (std::size_t i = 0; i < pairs.size(); ++i) EXPECT_GT(lower[i], margins[i]) << k << " " << i;
      EXPECT_EQ(any.view.pair[k], (BodyPair{kNone, kNone}));
      EXPECT_GT(any.view.lower[k], *std::min_element(margins.begin(), margins.end()));
      EXPECT_EQ(any.view.upper[k], kInf);
    }
  }
  EXPECT_GT(beyond, 5);
  EXPECT_GT(within, 5);
}

TEST_P(EngineTest, AnyAgreesWithAllPairs) {
  const engine::Engine engine = make(mixed_scene(60, 3, 5));
  Moved moved(60);
  const Answer dense = evaluate(engine, moved.query);
  const std::vector<BodyPair> pairs = engine.pairs(moved.query);
  QueryView q = moved.query;
  q.reduce = Reduce::kAny;
  for (const double margin : {0.0, 0.02, 0.3}) {
    q.margin = margin;
    const Answer any = evaluate(engine, q);
    expect_agrees(any, dense, pairs, std::vector<double>(pairs.size(), margin));
    if (GetParam() == "cpu") {
      EXPECT_LT(any.info.pairs_evaluated, dense.info.pairs_evaluated / 4);
    }
  }
}

TEST_P(EngineTest, AnyTestsEachPairAgainstItsOwnMargin) {
  engine::Scene scene = mixed_scene(60, 3, 5);
  scene.add_group("hand", std::vector<std::string>{"body1", "body3"});
  const engine::Engine engine = make(std::move(scene));
  Moved moved(60);
  const Answer dense = evaluate(engine, moved.query);
  const std::vector<BodyPair> pairs = engine.pairs(moved.query);
  // Later entries win; a pair may be named in either order.
  const MarginEntry entries[] = {
      {kEveryBody, kEveryBody, 0.1}, {kGroupBit, kEveryBody, 0.4}, {3, 7, 0}, {20, 1, 0.9}, {50, 50, 4}};
  std::vector<double> margins;
  for (const BodyPair p : pairs) {
    double margin = 0.1;
    if (p.a == 1 || p.b == 1 || p.a == 3 || p.b == 3) margin = 0.4;
    if (p == BodyPair{3, 7}) margin = 0;
    if (p == BodyPair{1, 20}) margin = 0.9;
    margins.push_back(margin);
  }
  ASSERT_EQ(std::count(margins.begin(), margins.end(), 0.9), 1);
  ASSERT_EQ(std::count(margins.begin(), margins.end(), 0.0), 1);
  QueryView q = moved.query;
  q.reduce = Reduce::kAny;
  q.margins = entries;
  const Answer by_entries = evaluate(engine, q);
  expect_agrees(by_entries, dense, pairs, margins);
  q.margins = {};
  q.pair_margins = margins;
  EXPECT_EQ(bits(evaluate(engine, q)), bits(by_entries));
  Random random(9);
  for (double& margin : margins) margin = random.uniform(0, 0.5);
  expect_agrees(evaluate(engine, q), dense, pairs, margins);
}

// A query of all bodies at their current poses: threads, slices and the search for near pairs have no effect.
TEST_P(EngineTest, AnyDoesNotDependOnThreadsSlicesOrTrees) {
  const int count = GetParam() == "cpu" ? 600 : 50;  // the oracle evaluates all pairs
  for (const double box : {6.0, 60.0}) {
    QueryView q;
    q.fields = kAllFields;
    q.reduce = Reduce::kAny;
    q.margin = box == 6.0 ? 0.01 : 1e-6;
    std::vector<std::byte> first;
    for (const char* near_by : {"brute", "tree"})
      for (const int threads : {1, 4}) {
        const engine::Engine engine(mixed_scene(count, box, 8),
                                    {.backend = GetParam(), .threads = threads, .broad_phase = near_by});
        for (const auto slice : {std::chrono::nanoseconds::max(), std::chrono::nanoseconds(20'000)}) {
          const Answer answer = evaluate(engine, q, slice);
          if (first.empty()) first = bits(answer);
          EXPECT_EQ(bits(answer), first) << near_by << " " << threads;
        }
      }
  }
}

TEST_P(EngineTest, AnyIsNotFreeWithoutPoses) {
  engine::Scene scene;
  scene.add_sphere("here", 0.1, {.pose = Pose{}});
  scene.add_sphere("far", 0.1, {.pose = Pose{{5, 0, 0}}});
  scene.add_sphere("nowhere", 0.1, {});
  engine::Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  q.reduce = Reduce::kAny;
  Answer a = evaluate(engine, q);
  EXPECT_EQ(a.view.status[0], std::uint8_t(Status::kNoPose)) << "the pair that is apart does not make it free";
  EXPECT_EQ(a.view.pair[0], (BodyPair{0, 2}));
  EXPECT_TRUE(a.view.flags[0] & kFlagIncomplete);
  engine.set_poses(std::vector<BodyPose>{{1, Pose{{0.15, 0, 0}}}});
  a = evaluate(engine, q);
  EXPECT_EQ(a.view.status[0], std::uint8_t(Status::kOverlap));
  EXPECT_EQ(a.view.pair[0], (BodyPair{0, 1}));
  EXPECT_TRUE(a.view.flags[0] & kFlagIncomplete);
  engine.set_poses(std::vector<BodyPose>{{1, Pose{{5, 0, 0}}}, {2, Pose{{std::nan(""), 0, 0}}}});
  EXPECT_EQ(evaluate(engine, q).view.status[0], std::uint8_t(Status::kBadPose));
  engine.set_poses(std::vector<BodyPose>{{2, Pose{{0, 0.2, 0}}}});
  a = evaluate(engine, q);
  EXPECT_EQ(a.view.status[0], std::uint8_t(Status::kUnconverged)) << "they touch in one point";
  EXPECT_EQ(a.view.pair[0], (BodyPair{0, 2}));
  engine.set_poses(std::vector<BodyPose>{{2, Pose{{0, 3, 0}}}});
  a = evaluate(engine, q);
  EXPECT_EQ(a.view.status[0], std::uint8_t(Status::kBeyond));
  EXPECT_EQ(a.view.flags[0], 0);
  const BodyPair unknown[] = {{0, 1}, {0, 99}};
  q.all_pairs = false;
  q.pairs = unknown;
  EXPECT_EQ(evaluate(engine, q).view.status[0], std::uint8_t(Status::kUnknownBody));
  q.pairs = {};
  EXPECT_EQ(evaluate(engine, q).view.status[0], std::uint8_t(Status::kBeyond)) << "no pair is no obstacle";
}

TEST_P(EngineTest, AnyDecidesNothingByOldPoses) {
  engine::Scene scene;
  scene.add_sphere("a", 0.1, {.pose = Pose{}});
  scene.add_sphere("b", 0.1, {.pose = Pose{{5, 0, 0}}});
  const engine::Engine engine = make(std::move(scene));
  QueryView q;
  q.fields = kAllFields;
  q.reduce = Reduce::kAny;
  q.max_pose_age_ns = 1'000'000'000;
  EXPECT_EQ(evaluate(engine, q).view.status[0], std::uint8_t(Status::kStalePose));
  q.max_pose_age_ns = 0;
  EXPECT_EQ(evaluate(engine, q).view.status[0], std::uint8_t(Status::kBeyond));
}

struct BadMargin {
  const char* text;
  void (*spoil)(QueryView&);
};

TEST_P(EngineTest, BadMarginsNameTheirFault) {
  static const double kFew[] = {0, 0}, kWrong[] = {0, 0, 0, -1, 0, 0};
  static const MarginEntry kNan[] = {{0, 1, 0}, {0, kEveryBody, std::nan("")}}, kUnknown[] = {{0, 77, 0}},
                           kNoGroup[] = {{kGroupBit | 3, 0, 0}}, kGood[] = {{0, 1, 0}};
  static const std::vector<MarginEntry> kMany(5000, MarginEntry{0, 1, 0});
  const BadMargin cases[] = {
      {"margin: expected a finite number of metres >= 0, got -", [](QueryView& q) { q.margin = -1e-3; }},
      {"margin: expected a finite number of metres >= 0, got nan", [](QueryView& q) { q.margin = std::nan(""); }},
      {"margin: expected a finite number of metres >= 0, got inf", [](QueryView& q) { q.margin = kInf; }},
      {"margins[1] ('body0', '*'): expected a finite number", [](QueryView& q) { q.margins = kNan; }},
      {"margins[0] ('body0', body 77): unknown body 77", [](QueryView& q) { q.margins = kUnknown; }},
      {"margins[0] (group 3, 'body0'): unknown group 3", [](QueryView& q) { q.margins = kNoGroup; }},
      {"5000 entries for 6 pairs are too many", [](QueryView& q) { q.margins = kMany; }},
      {"pair_margins: expected one for each of 6 pairs, got 2", [](QueryView& q) { q.pair_margins = kFew; }},
      {"pair_margins[3]: expected a finite number", [](QueryView& q) { q.pair_margins = kWrong; }},
      {"either entries or one for each pair",
       [](QueryView& q) {
         q.margins = kGood;
         q.pair_margins = kWrong;
       }},
      {"margin: only for reduce any",
       [](QueryView& q) {
         q.margin = 0.1;
         q.reduce = Reduce::kMin;
       }},
      {"max_distance: reduce any uses its margins", [](QueryView& q) { q.max_distance = 1; }},
      {"signed_distance: reduce any computes no depth", [](QueryView& q) { q.signed_distance = true; }},
  };
  const engine::Engine engine = make(mixed_scene(4, 3, 5));
  for (const BadMargin& bad : cases) {
    QueryView q;
    q.reduce = Reduce::kAny;
    bad.spoil(q);
    try {
      engine.size(q);
      ADD_FAILURE() << "nothing refused: " << bad.text;
    } catch (const engine::QueryError& error) {
      EXPECT_NE(std::string(error.what()).find(bad.text), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace clearance::test
