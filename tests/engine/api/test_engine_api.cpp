// The installed C++ interface of the engine.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "engine/api/engine.h"
#include "tests/prepared_calls.h"
#include "tests/temporary_folder.h"
#include "wire/api/decisions.h"

namespace clearance {
namespace {

constexpr Pose7 at(double x) {
  return {x, 0, 0, 1, 0, 0, 0};
}

/// A fixed unit box "a" at 0 and moving ones "b" at 2 and "c" at 5.
Scene boxes() {
  Scene scene;
  scene.add_box("a", {1, 1, 1}, {.is_static = true, .X_parent_body = at(0)});
  scene.add_box("b", {1, 1, 1}, {.X_parent_body = at(2)});
  scene.add_box("c", {1, 1, 1}, {.X_parent_body = at(5)});
  return scene;
}

Scene cell() {
  return Scene::load(CLEARANCE_SOURCE_DIR "/scenes/cell/robot.yaml");
}

template <class Error>
std::string text_of(auto&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(EngineApi, PreparedAnswersAsDistancesDoes) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  Prepared prepared = engine.prepare({.bodies = moved});
  for (const double x : {1.5, 3.0, 4.2, 0.5}) {
    const std::vector<Pose7> poses{at(x), at(-x)};
    const Result one = engine.distances({.bodies = moved, .configurations = poses}), again = prepared.run(poses);
    ASSERT_EQ(one.rows(), 4u);
    ASSERT_EQ(again.rows(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(again.lower()[i], one.lower()[i]);
      EXPECT_EQ(again.upper()[i], one.upper()[i]);
      EXPECT_EQ(again.status()[i], one.status()[i]);
    }
  }
  EXPECT_NEAR(prepared.run(std::vector<Pose7>{at(3)}).distance()[0], 2, 1e-6);
}

TEST(EngineApi, PreparedQueriesOfOneKindShareTheirJobs) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  const std::vector<Pose7> poses{at(2)};
  const auto reused = [&] {
    std::uint64_t jobs = 0;
    for (const auto& [name, value] : engine.stats())
      if (name == "engine.jobs_reused") jobs = value;
    return jobs;
  };
  const double distance = engine.prepare({.bodies = moved}).run(poses).distance()[0];
  engine.prepare({.bodies = moved, .abs_tol = 0.5}).run(poses);
  EXPECT_EQ(reused(), 0u);
  EXPECT_EQ(engine.prepare({.bodies = moved}).run(poses).distance()[0], distance);
  EXPECT_EQ(reused(), 1u);
}

TEST(EngineApi, PreparedCallsOfEachKindAnswerAsTheCalls) {
  const Engine engine(cell(), {.threads = 1});
  test::expect_prepared_calls_answer_as_calls(engine, engine.joints("arm"));
  test::expect_prepared_paths_answer_as_calls(engine, engine.joints("arm"));
}

TEST(EngineApi, PreparedOwnsItsArrays) {
  const Engine engine(boxes());
  std::vector<std::uint32_t> moved{1};
  std::vector<IdPair> pairs{{0, 1}};
  std::vector<MarginEntry> margins{{0, 1, 0.75}};
  Prepared prepared = engine.prepare(as_check({.pairs = pairs, .bodies = moved, .margins = margins}));
  moved[0] = 2;
  pairs[0] = {0, 2};
  margins[0].margin = 0;
  const std::vector<Pose7> poses{at(1.7), at(1.8)};
  const Check check = check_of(prepared.run(poses));
  EXPECT_EQ(check.free, (std::vector<bool>{false, true}));
  EXPECT_EQ(check.pair[0], (IdPair{0, 1}));
}

TEST(EngineApi, ChecksHaveAVerdictAndAPairPerConfiguration) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  const std::vector<Pose7> poses{at(2.25), at(1.1), at(0.5), at(std::nan(""))};  // free, near, overlapping, nowhere
  const Query query{.bodies = moved, .configurations = poses, .margin = 0.2};
  const Check check = engine.check(query);
  EXPECT_EQ(check.verdict, (std::vector{Status::kBeyond, Status::kOk, Status::kOk, Status::kBadPose}));
  EXPECT_EQ(check.free, (std::vector<bool>{true, false, false, false}));
  EXPECT_EQ(check.pair, (std::vector<IdPair>{{kNone, kNone}, {0, 1}, {0, 1}, {0, 1}}));
  EXPECT_TRUE(check.hit(2));
  EXPECT_FALSE(check.hit(3)) << "nothing is proved";
  const Result result = engine.distances(as_check(query));
  EXPECT_EQ(result.fields(), kFieldVerdict | kFieldPair);
  EXPECT_EQ(std::vector(result.verdict().begin(), result.verdict().end()), check.verdict);
}

TEST(EngineApi, MemoryOfAResultIsReusedOnceNoCopyOfItExists) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  Prepared prepared = engine.prepare({.bodies = moved});
  const std::vector<Pose7> near{at(1.5)}, far{at(4)};
  Result first = prepared.run(near);
  const double* const memory = first.lower().data();
  const Result copy = first;
  first = prepared.run(far);
  EXPECT_NE(first.lower().data(), memory);
  EXPECT_NEAR(copy.lower()[0], 0.5, 1e-6);
  EXPECT_NEAR(first.lower()[0], 3, 1e-6);
  const double* const second = first.lower().data();
  first = Result();
  EXPECT_EQ(prepared.run(near).lower().data(), second);
}

TEST(EngineApi, PreparedSurvivesChangesThatKeepItsIds) {
  Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  Prepared prepared = engine.prepare({.bodies = moved});
  const std::vector<Pose7> poses{at(2)};
  EXPECT_EQ(prepared.run(poses).rows(), 2u);
  engine.allow(0, 1);
  EXPECT_FALSE(prepared.is_stale());
  EXPECT_EQ(prepared.run(poses).rows(), 1u);
  engine.attach(1, 2);  // poses of "b" are relative to "c" from now on
  EXPECT_TRUE(prepared.is_stale());
  EXPECT_EQ(text_of<StaleQuery>([&] { prepared.run(poses); }),
            "prepared query: the body \"b\" is now \"b on c\": prepare it again");
  engine.attach(1, kNone);
  EXPECT_FALSE(prepared.is_stale());
  EXPECT_EQ(prepared.run(poses).rows(), 1u);
}

TEST(EngineApi, APreparedQueryRejectsInputsOfOthersInEachRun) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  const std::vector<Pose7> poses{at(2)};
  const std::vector<double> one(1), six(6);
  Prepared prepared = engine.prepare({.bodies = moved});
  for (int run = 0; run < 3; ++run) {
    EXPECT_EQ(prepared.run({.configurations = poses}).status()[0], Status::kOk);
    const auto text = [&](const Prepared::Inputs& inputs) {
      return text_of<QueryError>([&] { prepared.run(inputs); });
    };
    EXPECT_EQ(text({.configurations = poses, .twists = six}),
              "twists: only for the columns rate, rate_bounds and curvature")
        << run;
    EXPECT_EQ(text({.configurations = poses, .growths = one}), "growths: only for motions (max_evaluations)") << run;
  }
}

TEST(EngineApi, APathHasAGrowthForEachBodyAndRow) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  const std::vector<Pose7> poses{at(2), at(3), at(3.5)};
  const std::vector<double> one(1), three(3);
  EXPECT_EQ(text_of<std::invalid_argument>(
                [&] { engine.check_path({.bodies = moved, .configurations = poses, .growths = one}); }),
            "check_path: growths: expected 3, for each body in each row, got 1");
  EXPECT_TRUE(engine.check_path({.bodies = moved, .configurations = poses, .growths = three}).free);
}

TEST(EngineApi, PrepareRejectsInputsAndBadQueries) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{1};
  const std::vector<Pose7> poses{at(2)};
  EXPECT_EQ(text_of<std::invalid_argument>([&] { engine.prepare({.bodies = moved, .configurations = poses}); }),
            "prepare: configurations, positions, growths and velocities are inputs of run(), not of the query");
  EXPECT_NE(text_of<QueryError>([&] { engine.prepare({.rel_tol = NAN}); }), "nothing was thrown");
  EXPECT_EQ(text_of<std::invalid_argument>([&] { engine.prepare({.deadline_ns = 1}); }),
            "query: deadline_ns is for a daemon's client");
  const auto rejected = [&](const Query& query) { return text_of<QueryError>([&] { engine.prepare(query); }); };
  EXPECT_EQ(rejected(as_check({.bodies = moved, .margin = -1})),
            "margin: expected a finite number of metres >= 0, got -1.000000");
  EXPECT_EQ(rejected(as_check({.bodies = moved, .max_distance = 1})),
            "max_distance: reduce any uses its margins instead");
  EXPECT_EQ(rejected(as_motions({.bodies = moved, .reduce = Reduce::kNearest})),
            "reduce: motions are reduced by none, min and any");
  const std::vector<std::uint32_t> unknown{9};
  EXPECT_EQ(rejected({.bodies = unknown}), "bodies[0]: unknown body 9");
  engine.prepare(as_motions({.bodies = moved}));
  Prepared prepared = engine.prepare({.bodies = moved});
  EXPECT_NE(text_of<std::invalid_argument>([&] { prepared.run(std::vector<double>{1}); }), "nothing was thrown");
}

TEST(EngineApi, SubmittedQueriesCallBack) {
  const Engine engine(boxes());
  std::mutex mutex;
  std::condition_variable changed;
  int called = 0;
  const auto count = [&] {
    const std::lock_guard lock(mutex);
    ++called;
    changed.notify_one();
  };
  Pending pending = engine.submit({.reduce = Reduce::kMin}, count);
  const auto wait_until_called = [&](int times) {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return called == times; });
  };
  wait_until_called(1);
  EXPECT_TRUE(pending.ready());
  const Result result = pending.get();
  EXPECT_NEAR(result.distance()[0], 1, 1e-6);
  EXPECT_THROW(pending.get(), std::logic_error);

  const std::vector<std::uint32_t> moved{1};
  Prepared prepared = engine.prepare({.bodies = moved});
  std::vector<Pose7> poses{at(3)};
  Pending first = prepared.submit({.configurations = poses});
  poses[0] = at(4);
  Pending second = prepared.submit({.configurations = poses}, count);
  EXPECT_NEAR(second.get().distance()[0], 3, 1e-6);
  EXPECT_TRUE(first.wait_for(std::chrono::nanoseconds(0)));  // answered in order
  EXPECT_NEAR(first.get().distance()[0], 2, 1e-6);
  wait_until_called(2);
}

TEST(EngineApi, AbandonedQueriesLeaveTheEngineUsable) {
  std::vector<std::uint32_t> moved{1};
  const std::vector<Pose7> poses(100000, at(2.25));
  const Engine engine(boxes());
  for (int i = 0; i < 3; ++i) (void)engine.submit({.bodies = moved, .configurations = poses});
  EXPECT_NEAR(engine.submit({.reduce = Reduce::kMin}).get().distance()[0], 1, 1e-6);
}

TEST(EngineApi, PathsAreCheckedBetweenTheirWaypoints) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{2};
  const std::vector<Pose7> through{at(8), at(5), at(3.5), at(-3)}, away{at(5), at(8)};
  const PathCheck hit = engine.check_path({.bodies = moved, .configurations = through});
  EXPECT_FALSE(hit.ok());
  EXPECT_TRUE(hit.hit());
  EXPECT_EQ(hit.index, 2u);  // both of its ends are free
  EXPECT_EQ(hit.pair, (IdPair{1, 2}));
  EXPECT_TRUE(engine.check_path({.bodies = moved, .configurations = away}).ok());
  EXPECT_EQ(text_of<std::invalid_argument>(
                [&] { engine.check_path({.bodies = moved, .configurations = std::span(away).first(1)}); }),
            "check_path: expected two waypoints or more, got 1");
  const Result motions =
      engine.motions({.bodies = moved, .configurations = std::span(through).last(2), .reduce = Reduce::kMin});
  EXPECT_EQ(motions.rows(), 1u);
  EXPECT_LE(motions.upper()[0], 1e-3);
  EXPECT_EQ(motions.first_contact().size(), 2u);
}

TEST(EngineApi, PathsRequestDetailsOfTheFirstMotionWithoutAProofAlone) {
  const Engine engine(boxes());
  const std::vector<std::uint32_t> moved{2};
  std::vector<Pose7> path(20, at(6));
  path[13] = at(-3);  // motions 12 and 13 pass through the boxes
  const Query query{.bodies = moved, .configurations = path};
  using Request = std::pair<std::uint32_t, std::size_t>;  // columns, and motions
  std::vector<Request> requests;
  bool loses_proofs = false;
  const auto check = [&] {
    requests.clear();
    return check_path_with(
        query,
        [&](Query motions) {
          requests.emplace_back(motions.fields, motions.configurations.size() / 2);
          if (loses_proofs && motions.fields == kFieldVerdict) motions.margin = 100;
          return engine.distances(motions);
        },
        [](const Result&) { return std::make_shared<const JointsInfo>(); });
  };
  constexpr std::uint32_t kDetails = kFieldStatus | kFieldPair | kFieldTime | kFieldFirstContact;
  const PathCheck found = check();
  EXPECT_EQ(found.index, 12u);
  EXPECT_EQ(requests, (std::vector<Request>{{kFieldVerdict, 8}, {kFieldVerdict, 11}, {kDetails, 1}}));
  loses_proofs = true;  // details may prove a motion that the verdict leaves open
  const PathCheck again = check();
  EXPECT_EQ(again.index, found.index);
  EXPECT_EQ(again.t, found.t);
  EXPECT_EQ(again.pair, found.pair);
  EXPECT_EQ(again.status, found.status);
  EXPECT_EQ(requests.size(), 26u);
}

TEST(EngineApi, JointsByGroupWithLimits) {
  const Engine engine(cell());
  const Joints joints = engine.joints("arm");
  ASSERT_EQ(joints.size(), 7u);
  EXPECT_EQ(joints.names[0], "arm/turn");
  EXPECT_EQ(joints.ids, engine.joints("*").ids);
  EXPECT_EQ(engine.joints("arm/elbow").ids, (std::vector<std::uint32_t>{joints.ids[2]}));
  EXPECT_EQ(text_of<std::invalid_argument>([&] { engine.joints("arn"); }),
            "no robot or group of joints \"arn\" in the scene; did you mean \"arm\"?");

  std::vector<double> home;
  for (const JointInfo& joint : engine.joint_states().joints) home.push_back(joint.position);
  EXPECT_DOUBLE_EQ(home[2], 1.3);
  EXPECT_TRUE(engine.check({.joints = joints.ids, .positions = home}).ok(0));
  const std::vector<double> scales = engine.free_scale({.joints = joints.ids, .positions = home}, std::vector(7, 1.0));
  EXPECT_GT(scales.at(0), 0);

  std::vector<double> path = home;
  path.insert(path.end(), home.begin(), home.end());
  path[7] = joints.limits[0].upper + 0.01;
  const PathCheck check = engine.check_path({.joints = joints.ids, .positions = path});
  ASSERT_EQ(check.limit_violations.size(), 1u);
  EXPECT_EQ(check.limit_violations[0].configuration, 1u);
  EXPECT_NEAR(check.limit_violations[0].excess(), 0.01, 1e-12);
  EXPECT_FALSE(check.ok());
}

TEST(EngineApi, CurvesAreCheckedAgainstLimitsThroughout) {
  const Engine engine(cell());
  const Joints joints = engine.joints("arm");
  const double upper = joints.limits[0].upper;
  PreparedPath prepared = engine.prepare_path({.joints = joints.ids, .control_points = 3});
  const auto violations = [&](double middle) {  // of two segments, the first within limits
    std::vector<double> path(6 * joints.size());
    for (const std::size_t row : {3, 4, 5}) path[row * joints.size()] = row == 4 ? middle : upper - 0.1;
    return prepared.run(path).limit_violations;
  };
  EXPECT_TRUE(violations(upper + 0.09).empty()) << "the curve reaches half as far as its control point";
  const std::vector<LimitViolation> beyond = violations(upper + 0.12);
  ASSERT_EQ(beyond.size(), 1u);
  EXPECT_EQ(beyond[0].configuration, 1u);
  EXPECT_EQ(beyond[0].joint, joints.ids[0]);
  EXPECT_GT(beyond[0].excess(), 0);
  EXPECT_LT(beyond[0].excess(), 0.0101);
  EXPECT_EQ(text_of<std::invalid_argument>([&] { prepared.run(std::vector<double>(4 * joints.size())); }),
            "check_path: expected 3 control points for each segment, got 4 rows");
  EXPECT_EQ(text_of<std::invalid_argument>([&] {
              engine.check_path({.joints = joints.ids, .positions = std::vector<double>(14), .control_points = 9});
            }),
            "check_path: control_points: expected 2 to 8, got 9");
}

TEST(EngineApi, ScenesAreSavedAndDescribed) {
  const TemporaryFolder folder;
  const Scene scene = cell();
  scene.save(folder / "saved");
  EXPECT_EQ(Scene::load((folder / "saved") + "/scene.yaml").revision(), scene.revision());
  const Engine engine(scene);
  const SceneInfo info = engine.scene();
  EXPECT_EQ(info.bodies[engine.body("ball")].name, "ball");
  EXPECT_EQ(info.groups[engine.group("held") & ~kGroupBit].bodies.size(), 3u);
  EXPECT_EQ(info.pair_count, engine.pairs().size());
  EXPECT_EQ(engine.body_states()[engine.body("ball")].pose, (Pose7{0.35, -0.35, 1.6, 1, 0, 0, 0}));
  EXPECT_EQ(text_of<std::invalid_argument>([&] { engine.body("bal"); }),
            "no body \"bal\" in the scene; did you mean \"ball\", \"bin\"?");
}

TEST(EngineApi, UncertaintyAndCloudsCount) {
  Scene scene = boxes();
  scene.add_box("vague", {1, 1, 1}, {.X_parent_body = at(-3), .uncertainty_position = 0.25});
  const std::uint32_t cloud = scene.add_points("cloud", {}, 0, {.X_parent_body = at(-6)});
  Engine engine(std::move(scene));
  const std::vector<IdPair> pair{{0, 3}}, of_cloud{{0, cloud}};
  const Result vague = engine.distances({.pairs = pair});
  EXPECT_NEAR(vague.lower()[0], 1.75, 1e-6);  // 2 m, less the ball that contains its origin
  const std::vector<std::array<float, 3>> points{{0, 0, 0}, {1, 0, 0}};
  EXPECT_EQ(engine.set_points(cloud, points).applied, 2u);
  EXPECT_NEAR(engine.distances({.pairs = of_cloud}).distance()[0], 4.5, 1e-6);
}

TEST(EngineApi, CertificatesAreDocuments) {
  const Engine engine(boxes());
  const std::string document = engine.certificate({}, std::vector<std::uint64_t>{0});
  EXPECT_EQ(document.front(), '{');
  EXPECT_NE(document.find("\"rows\""), std::string::npos);
}

}  // namespace
}  // namespace clearance
