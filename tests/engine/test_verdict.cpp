// The column `verdict` of Reduce::kAny: status without the kind of a hit.
#include <algorithm>
#include <cmath>

#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

Status without_kind_of_hit(Status status) {
  return status == Status::kContact || status == Status::kOverlap ? Status::kOk : status;
}

std::vector<Status> statuses(const std::uint8_t* column, std::uint64_t rows) {
  std::vector<Status> found;
  for (std::uint64_t i = 0; i < rows; ++i) found.push_back(static_cast<Status>(column[i]));
  return found;
}

// Compares the verdicts of a query with its statuses, with and without other columns.
// \returns the statuses
std::vector<Status> expect_verdicts(const engine::Engine& engine, QueryView q) {
  q.reduce = Reduce::kAny;
  q.fields = kAllFields;
  const Answer known = evaluate(engine, q);
  const std::vector<Status> status = statuses(known.view.status, known.info.rows);
  std::vector<Status> expected = status;
  std::ranges::transform(expected, expected.begin(), without_kind_of_hit);
  for (const std::uint32_t others : {0u, kFieldPair | 0u, kFieldStatus | 0u, kAllFields | 0u}) {
    q.fields = kFieldVerdict | others;
    const Answer answer = evaluate(engine, q);
    EXPECT_EQ(answer.size.fields, q.fields) << "no other column is forced";
    EXPECT_EQ(statuses(answer.view.verdict, answer.info.rows), expected) << others;
    for (std::uint64_t k = 0; k < answer.info.rows; ++k) {
      if (answer.view.pair) {
        EXPECT_EQ(answer.view.pair[k], known.view.pair[k]) << k;
      }
      if (answer.view.status) {
        EXPECT_EQ(answer.view.status[k], known.view.status[k]) << k;
      }
    }
  }
  return status;
}

TEST_P(EngineTest, VerdictOfEachKindOfDecision) {
  engine::Scene scene;
  scene.add_sphere("a", 0.1, {.pose = Pose{}});
  const std::vector<std::uint32_t> moved{scene.add_sphere("ball", 0.1, {.pose = Pose{{5, 0, 0}}})};
  const engine::Engine engine = make(std::move(scene));
  // Free, overlapping, touching, within the margin of 0.1, and without a position.
  std::vector<Pose> poses;
  for (const double x : {1.0, 0.15, 0.2, 0.25, std::nan("")}) poses.push_back(Pose{{x, 0, 0}});
  QueryView q;
  q.bodies = moved;
  q.configurations = poses;
  q.configuration_count = 5;
  q.margin = 0.1;
  EXPECT_EQ(expect_verdicts(engine, q),
            (std::vector{Status::kBeyond, Status::kOverlap, Status::kContact, Status::kOk, Status::kBadPose}));
  q.margin = 0;
  EXPECT_EQ(expect_verdicts(engine, q),
            (std::vector{Status::kBeyond, Status::kOverlap, Status::kUnconverged, Status::kBeyond, Status::kBadPose}));
  QueryView now;
  EXPECT_EQ(expect_verdicts(engine, now), std::vector{Status::kBeyond});
  now.max_pose_age_ns = 1'000'000'000;
  EXPECT_EQ(expect_verdicts(engine, now), std::vector{Status::kStalePose});
  const BodyPair unknown[] = {{0, 1}, {0, 99}};
  now.max_pose_age_ns = 0;
  now.all_pairs = false;
  now.pairs = unknown;
  EXPECT_EQ(expect_verdicts(engine, now), std::vector{Status::kUnknownBody});
  now.pairs = {};
  EXPECT_EQ(expect_verdicts(engine, now), std::vector{Status::kBeyond}) << "no pair is no obstacle";
}

TEST_P(EngineTest, VerdictWithoutPosesIsTheReasonUnlessAnotherPairIsHit) {
  engine::Scene scene;
  scene.add_sphere("here", 0.1, {.pose = Pose{}});
  scene.add_sphere("far", 0.1, {.pose = Pose{{5, 0, 0}}});
  scene.add_sphere("nowhere", 0.1, {});
  engine::Engine engine = make(std::move(scene));
  EXPECT_EQ(expect_verdicts(engine, {}), std::vector{Status::kNoPose});
  engine.set_poses(std::vector<BodyPose>{{1, Pose{{0.15, 0, 0}}}});
  EXPECT_EQ(expect_verdicts(engine, {}), std::vector{Status::kOverlap});
}

TEST_P(EngineTest, VerdictsOfManyConfigurations) {
  const engine::Engine engine = make(mixed_scene(60, 3, 5));
  const std::vector<std::uint32_t> moved{1, 2, 3};
  std::vector<Pose> poses;
  Random random(6);
  for (int i = 0; i < 180; ++i) poses.push_back(random.pose(i < 120 ? 1.6 : 60));
  QueryView q;
  q.bodies = moved;
  q.configurations = poses;
  q.configuration_count = 60;
  std::vector<Status> seen;
  for (const double margin : {0.0, 0.3}) {
    q.margin = margin;
    std::ranges::copy(expect_verdicts(engine, q), std::back_inserter(seen));
  }
  for (const Status status : {Status::kOk, Status::kOverlap, Status::kBeyond})
    EXPECT_GT(std::ranges::count(seen, status), 5) << static_cast<int>(status);
}

TEST_P(EngineTest, VerdictIsForDecisionsOnly) {
  const engine::Engine engine = make(mixed_scene(4, 3, 5));
  const auto rejection = [&](const QueryView& q) -> std::string {
    try {
      engine.size(q);
      return "";
    } catch (const engine::QueryError& error) {
      EXPECT_EQ(error.code, QueryErrorCode::kBadQuery);
      return error.what();
    }
  };
  const std::vector<std::uint32_t> moved{1};
  const std::vector<Pose> ends{Pose{}, Pose{{1, 0, 0}}};
  for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kNearest, Reduce::kMin})
    for (const std::uint32_t others : {0u, kDefaultFields | 0u}) {
      QueryView q;
      q.reduce = reduce;
      q.fields = kFieldVerdict | others;
      EXPECT_EQ(rejection(q), "fields: verdict needs reduce any") << static_cast<int>(reduce);
      if (reduce == Reduce::kWithin || reduce == Reduce::kNearest) continue;
      q.bodies = moved;
      q.configurations = ends;
      q.configuration_count = 2;
      q.max_evaluations = 8;
      EXPECT_EQ(rejection(q), "fields: verdict needs reduce any") << "motions, " << static_cast<int>(reduce);
    }
  QueryView q;
  q.reduce = Reduce::kAny;
  q.fields = kFieldVerdict;
  EXPECT_EQ(rejection(q), "");
}

}  // namespace
}  // namespace clearance::test
