// Joint positions as part of the snapshot, and queries in joint space.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/cuda/same_answer.h"
#include "tests/engine/engine_test_util.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using test::Answer;
using test::arm_scene;
using test::at_home;
using test::evaluate;
using test::joints_of;
using test::kArm;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Positions within the arm's limits.
std::vector<double> random_rows(const engine::Scene& scene, const std::vector<std::uint32_t>& joints, std::size_t count,
                                std::uint64_t seed) {
  test::Random random(seed);
  std::vector<double> rows;
  for (std::size_t k = 0; k < count; ++k)
    for (const std::uint32_t j : joints)
      rows.push_back(random.uniform(scene.joints()[j].lower, scene.joints()[j].upper));
  return rows;
}

// The rows of `some` are those of `all` from `first` on, bit for bit, apart from the configuration.
void expect_same_rows(const Answer& all, std::uint64_t first, const Answer& some) {
  const auto same = [&](const auto* x, const auto* y, int width) {
    if (!y || static_cast<const void*>(y) == some.view.configuration) return;
    for (std::uint64_t i = 0; i < some.info.rows * static_cast<std::uint64_t>(width); ++i)
      ASSERT_TRUE(test::same_bits(x[first * static_cast<std::uint64_t>(width) + i], y[i]))
          << "entry " << i << " of width " << width;
  };
  for_each_column([&](auto* x, auto* y, int width) { same(x, y, width); }, all.view, some.view);
}

TEST(JointState, LinksAreWhereKinematicsPutsThem) {
  engine::Scene scene = arm_scene(at_home());
  const std::vector<std::uint32_t> joints = joints_of(scene, "arm");
  const SceneRobot& robot = *scene.robots()[0];
  engine::Engine engine(scene, test::kWithoutCovers);
  const std::vector<double> row = random_rows(scene, joints, 1, 1);
  std::vector<JointPosition> update;
  for (std::size_t i = 0; i < joints.size(); ++i) update.push_back({joints[i], row[i]});
  const std::uint64_t before = engine.pose_revision();
  const PoseUpdateResult done = engine.set_joints(update);
  EXPECT_EQ(done.applied, 8u);
  EXPECT_EQ(done.revision, before + 1);
  std::vector<Pose> poses(robot.model.links.size());
  std::vector<Status> status(1);
  robot.kinematics.place(row, std::vector<Pose>(1), poses, status);
  for (std::uint32_t link = 0; link < poses.size(); ++link) {
    const BodyState state = engine.body_state(robot.bodies[link]);
    EXPECT_EQ(state.status, Status::kOk);
    EXPECT_EQ(std::memcmp(&state.X_wb, &poses[link], sizeof(Pose)), 0) << robot.model.links[link].name;
  }
}

TEST(JointState, WithoutAPositionNoPoseAndBadPositionsAreBadPoses) {
  engine::RobotOptions options;
  options.urdf = kArm;
  const engine::Scene scene = arm_scene(options);
  engine::Engine engine(scene, test::kWithoutCovers);
  const auto status = [&](const char* link) { return engine.body_state(scene.find_body(link)).status; };
  EXPECT_EQ(status("arm/base"), Status::kOk) << "no joint moves it";
  EXPECT_EQ(status("arm/upper"), Status::kNoPose);
  std::vector<JointPosition> update;
  for (std::uint32_t j = 0; j < 3; ++j) update.push_back({j, 0.1});
  engine.set_joints(update);
  EXPECT_EQ(status("arm/elbow"), Status::kOk);
  EXPECT_EQ(status("arm/fore"), Status::kNoPose) << "joint4 has no position yet";
  for (const double bad : {kNaN, 1.1e6, -std::numeric_limits<double>::infinity()}) {
    const JointPosition one[] = {{1, bad}};
    EXPECT_EQ(engine.set_joints(one).bad, 1u);
    EXPECT_EQ(status("arm/upper"), Status::kBadPose);
    EXPECT_EQ(status("arm/base"), Status::kOk);
    EXPECT_EQ(engine.joint_state(1).status, Status::kBadPose);
  }
  const JointPosition good[] = {{1, 0.2}};
  engine.set_joints(good);
  EXPECT_EQ(status("arm/elbow"), Status::kOk);
  EXPECT_EQ(engine.joint_state(0).status, Status::kOk);
  EXPECT_EQ(engine.joint_state(5).status, Status::kNoPose);
}

TEST(JointState, PublishingALinksPoseIsRejectedWithAReason) {
  const engine::Scene scene = arm_scene(at_home());
  engine::Engine engine(scene, test::kWithoutCovers);
  const std::uint32_t fore = scene.find_body("arm/fore"), ball = scene.find_body("ball");
  const BodyPose pose[] = {{fore, Pose{}}};
  const auto has = [](const std::string& what) {
    EXPECT_NE(what.find("'arm/fore' is a link placed by joints"), std::string::npos) << what;
  };
  has(error_text<engine::QueryError>([&] { engine.set_poses(pose); }));
  has(error_text<engine::QueryError>([&] { engine.attach(fore, ball); }));
  const Pose one[] = {Pose{}};
  QueryView query;
  query.configuration_count = 1;
  query.bodies = std::span(&fore, 1);
  query.configurations = one;
  has(error_text<engine::QueryError>([&] { engine.size(query); }));
}

TEST(JointState, UpdatesThatMakeNoSenseAreRejectedWhole) {
  const engine::Scene scene = arm_scene(at_home());
  engine::Engine engine(scene, test::kWithoutCovers);
  const JointPosition twice[] = {{2, 0.5}, {2, 0.6}};
  EXPECT_EQ(error_text<engine::QueryError>([&] { engine.set_joints(twice); }), "joints: 'arm/joint3' is named twice");
  const JointPosition one[] = {{2, 0.5}};
  engine.set_joints(one, 2000, 1, 7);
  EXPECT_NE(error_text<engine::QueryError>([&] {
              engine.set_joints(one, 1000, 2, 7);
            }).find("is older than 2000, the last from this publisher for 'arm/joint3'"),
            std::string::npos);
  EXPECT_EQ(engine.joint_state(2).stamp_ns, 2000);
  const JointPosition unknown[] = {{99, 0.5}};
  EXPECT_EQ(engine.set_joints(unknown).unknown, 1u);
}

TEST(JointState, TheOldestJointOnTheWayIsALinksStamp) {
  const engine::Scene scene = arm_scene(at_home());
  engine::Engine engine(scene, test::kWithoutCovers);
  const JointPosition first[] = {{0, 0.1}}, second[] = {{1, 0.1}};
  engine.set_joints(second, 1000, 1, 1);
  engine.set_joints(first, 5000, 1, 2);
  EXPECT_EQ(engine.oldest_stamp(scene.find_body("arm/shoulder")), 5000);
  EXPECT_EQ(engine.oldest_stamp(scene.find_body("arm/palm")), 1000);
}

TEST(JointState, WhatFollowsALinkMovesWithItAndAReloadTakesPositionsOver) {
  const engine::Scene scene = arm_scene(at_home());
  engine::Engine engine(scene, test::kWithoutCovers);
  const std::uint32_t ball = scene.find_body("ball"), palm = scene.find_body("arm/palm");
  const Pose held{{0, 0, 0.2}};
  engine.attach(ball, palm, &held);
  const Pose before = engine.body_state(ball).X_wb;
  const JointPosition turn[] = {{0, 1.0}};
  engine.set_joints(turn);
  const Pose after = engine.body_state(ball).X_wb;
  EXPECT_GT(std::abs(after.translation.y - before.translation.y), 0.1);
  engine::Engine reloaded(scene, test::kWithoutCovers);
  reloaded.take_poses(engine);
  EXPECT_EQ(reloaded.joint_state(0).position, 1.0);
  const Pose taken = reloaded.body_state(ball).X_wb;
  EXPECT_EQ(std::memcmp(&taken, &after, sizeof(Pose)), 0);
}

TEST(JointState, BeyondItsLimitsAJointFlagsWhatItMoves) {
  engine::Scene scene = arm_scene(at_home());
  engine::Engine engine(scene, test::kWithoutCovers);
  const JointPosition over[] = {{3, 0.5}};  // joint4: -3.07 to -0.07
  engine.set_joints(over);
  EXPECT_TRUE(engine.joint_state(3).beyond_limits);
  QueryView query;
  query.fields = kDefaultFields | kFieldFlags;
  const Answer a = evaluate(engine, query);
  const std::vector<BodyPair> pairs = engine.pairs({});
  std::size_t flagged = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto beyond = [&](std::uint32_t body) {
      const std::string& name = scene.bodies()[body].name;
      return name.starts_with("arm/") && name != "arm/base" && name != "arm/upper";
    };
    const bool is_flagged = a.view.flags[i] & kFlagBeyondLimits;
    EXPECT_EQ(is_flagged, beyond(pairs[i].a) || beyond(pairs[i].b));
    flagged += is_flagged;
  }
  EXPECT_GT(flagged, 0u);
  EXPECT_LT(flagged, pairs.size());
}

TEST(JointQuery, AnswersAreThoseOfJointsThatAreSetBitForBit) {
  const engine::Scene scene = arm_scene(at_home());
  const std::vector<std::uint32_t> joints = joints_of(scene, "arm");
  constexpr std::uint32_t kCount = 37;
  const std::vector<double> rows = random_rows(scene, joints, kCount, 3);
  const engine::Engine engine(scene, test::kWithoutCovers);
  engine::Engine set(scene, test::kWithoutCovers);
  QueryView query;
  query.joints = joints;
  const std::vector<BodyPair> pairs = engine.pairs(query);
  ASSERT_GT(pairs.size(), 20u);
  query.pairs = pairs;
  query.all_pairs = false;
  query.configuration_count = kCount;
  query.positions = rows;
  query.fields = test::kAllFields;
  for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kMin, Reduce::kNearest}) {
    query.reduce = reduce;
    query.max_distance = reduce == Reduce::kWithin ? 0.2 : 1e9;
    const Answer all = evaluate(engine, query);
    std::uint64_t first = 0;
    for (std::uint32_t k = 0; k < kCount; ++k) {
      std::vector<JointPosition> update;
      for (std::size_t j = 0; j < joints.size(); ++j) update.push_back({joints[j], rows[k * joints.size() + j]});
      set.set_joints(update);
      QueryView now = query;
      now.joints = {};
      now.positions = {};
      now.configuration_count = 0;
      const Answer one = evaluate(set, now);
      ASSERT_LE(first + one.info.rows, all.info.rows);
      expect_same_rows(all, first, one);
      first += one.info.rows;
    }
    EXPECT_EQ(first, all.info.rows);
  }
}

// Two branches with sliding joints, one of them planar, and a link on neither.
constexpr const char* kSliding = R"(<robot name="r">
<link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="cart"><collision><geometry><box size="0.2 0.3 0.1"/></geometry></collision></link>
<link name="mast"><collision><geometry><capsule radius="0.05" length="0.4"/></geometry></collision></link>
<link name="tip"><collision><origin xyz="-0.006 -0.375 -0.094"/><geometry><sphere radius="0.02"/></geometry></collision></link>
<link name="post"><collision><geometry><cylinder radius="0.1" length="0.2"/></geometry></collision></link>
<link name="arm"><collision><origin xyz="0 0 0.3"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="drive" type="planar"><parent link="base"/><child link="cart"/><origin xyz="1 2 3"/><axis xyz="0 0 1"/></joint>
<joint name="turn" type="continuous"><parent link="cart"/><child link="mast"/><origin xyz="0.1 -0.2 0.3" rpy="0.1 -1.5 3.1"/></joint>
<joint name="lift" type="prismatic"><parent link="mast"/><child link="tip"/><origin rpy="-1.668 -0.5664 3.0642"/><axis xyz="0.663 -0.514 -1.648"/><limit lower="-3" upper="3"/></joint>
<joint name="rail" type="prismatic"><parent link="base"/><child link="post"/><origin xyz="-0.7 0 0"/><axis xyz="1 2 2"/><limit lower="-3" upper="3"/><mimic joint="lift" multiplier="-0.7" offset="0.1"/></joint>
<joint name="bend" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0.4 0.1"/></joint>
</robot>)";

// The whole interval depends on the joints in the query, not on the state that it replaces.
TEST(JointQuery, WhereItsJointsStandDoesNotCount) {
  const TemporaryFolder folder;
  engine::RobotOptions options;
  options.urdf = folder.write("r.urdf", kSliding);
  options.home = std::map<std::string, double>{};
  options.parent = "carrier";
  engine::Scene scene;
  scene.add_sphere("carrier", 0.1, {.pose = Pose{{0.3, 0.1, -0.2}, 0.9, 0.1, -0.3, 0.2}});
  scene.add_box("table", {1, 1, 0.1}, {.is_static = true, .pose = Pose{{0.5, 0, -0.1}}});
  scene.add_robot("r", options);
  scene.add_sphere("held", 0.05, {.parent = "r/tip", .pose = Pose{{0, 0.1, 0}}});
  std::vector<std::uint32_t> all(scene.joints().size());
  for (std::uint32_t j = 0; j < all.size(); ++j) all[j] = j;
  std::vector<BodyPair> pairs;
  for (std::uint32_t b = 1; b < scene.bodies().size(); ++b)
    for (std::uint32_t a = 0; a < b; ++a)
      if (!scene.bodies()[a].parts.empty() && !scene.bodies()[b].parts.empty()) pairs.push_back({a, b});
  const auto stand = [](engine::Engine& engine, const std::vector<std::uint32_t>& joints,
                        const std::vector<double>& at) {
    std::vector<JointPosition> update;
    for (std::size_t i = 0; i < joints.size(); ++i) update.push_back({joints[i], at[i]});
    engine.set_joints(update);
  };
  const std::vector<std::uint32_t> lift{scene.find_joint("r/lift")}, bend{scene.find_joint("r/bend")};
  for (const std::vector<std::uint32_t>& joints : {all, lift, bend}) {
    const std::vector<double> rows = [&] {
      test::Random random(4);
      std::vector<double> q;
      for (std::size_t i = 0; i < 2 * joints.size(); ++i) q.push_back(random.uniform(-2, 2));
      return q;
    }();
    for (const double others : {0.5, 1e5}) {
      engine::Engine set(scene), stood(scene);
      stand(set, all, std::vector<double>(all.size(), others));
      stand(set, joints, {rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(joints.size())});
      for (const double standing : {0.5, -2.9, 1e3, 1e6}) {
        stand(stood, all, std::vector<double>(all.size(), others));
        stand(stood, joints, std::vector<double>(joints.size(), standing));
        for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny}) {
          QueryView query;
          query.pairs = pairs;
          query.all_pairs = false;
          query.fields = reduce == Reduce::kAny ? kFieldStatus | kFieldLower | kFieldUpper : test::kAllFields;
          query.reduce = reduce;
          query.rel_tol = 0;
          const Answer expected = evaluate(set, query);
          query.joints = joints;
          query.positions = rows;
          query.configuration_count = 2;
          expect_same_rows(evaluate(stood, query), 0, expected);
        }
      }
    }
  }
}

TEST(JointQuery, OtherJointsStayAndBodiesMayMoveToo) {
  const engine::Scene scene = arm_scene(at_home());
  const std::vector<std::uint32_t> joints = joints_of(scene, "arm");
  const std::uint32_t ball = scene.find_body("ball");
  engine::Engine engine(scene), other(scene);
  const JointPosition bent[] = {{1, 0.7}, {3, -1.0}};
  engine.set_joints(bent);
  const std::uint32_t requested[] = {5, 0};  // in any order
  const double rows[] = {1.5, 0.3, 0.2, -0.4};
  const Pose balls[] = {Pose{{0.3, 0.2, 0.4}}, Pose{{0.1, 0.5, 0.6}}};
  QueryView query;
  query.configuration_count = 2;
  query.joints = requested;
  query.positions = rows;
  query.bodies = std::span(&ball, 1);
  query.configurations = balls;
  query.fields = test::kAllFields;
  const Answer a = evaluate(engine, query);
  for (std::uint32_t k = 0; k < 2; ++k) {
    const JointPosition all[] = {{1, 0.7}, {3, -1.0}, {5, rows[2 * k]}, {0, rows[2 * k + 1]}};
    other.set_joints(all);
    const BodyPose moved[] = {{ball, balls[k]}};
    other.set_poses(moved);
    const std::vector<BodyPair> pairs = engine.pairs(query);
    QueryView now;
    now.pairs = pairs;
    now.all_pairs = false;
    const Answer b = evaluate(other, now);
    ASSERT_EQ(b.info.rows, pairs.size());
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      EXPECT_EQ(a.view.lower[k * pairs.size() + i], b.view.lower[i]);
      EXPECT_EQ(a.view.upper[k * pairs.size() + i], b.view.upper[i]);
    }
  }
}

TEST(JointQuery, WhatIsWrongWithItIsReported) {
  const engine::Scene scene = arm_scene(at_home());
  const engine::Engine engine(scene, test::kWithoutCovers);
  const std::uint32_t two[] = {0, 1}, twice[] = {0, 0}, unknown[] = {0, 77};
  const double numbers[] = {0, 0, 0, 0};
  const auto text = [&](std::span<const std::uint32_t> joints, std::uint32_t count, std::size_t given) {
    QueryView query;
    query.joints = joints;
    query.positions = std::span(numbers).first(given);
    query.configuration_count = count;
    return error_text<engine::QueryError>([&] { engine.prepare(query); });
  };
  EXPECT_EQ(text(two, 2, 3), "positions: expected 4 numbers (2 x 2), got 3");
  EXPECT_EQ(text(twice, 1, 2), "joints[1]: 'arm/joint1' is named twice");
  EXPECT_EQ(text(unknown, 1, 2), "joints[1]: unknown joint 77; the scene has 8");
  EXPECT_EQ(text(two, 0, 2), "positions: expected 0 numbers (0 x 2), got 2");
  QueryView frame;
  const BodyPair pair[] = {{0, scene.find_body("arm")}};
  frame.pairs = pair;
  frame.all_pairs = false;
  EXPECT_EQ(error_text<engine::QueryError>([&] { engine.size(frame); }), "pairs[0]: 'arm' is a frame without geometry");
}

TEST(JointQuery, BadPositionsAndMissingOnesAreStatusesOfTheirRows) {
  engine::RobotOptions options;
  options.urdf = kArm;
  const engine::Scene scene = arm_scene(options);  // no joint has a position
  const engine::Engine engine(scene, test::kWithoutCovers);
  const std::uint32_t joints[] = {0, 1};
  const double rows[] = {0.1, 0.2, 0.1, kNaN, 2e6, 0.2, 0.1, 9.0};
  QueryView query;
  query.joints = joints;
  query.positions = rows;
  query.configuration_count = 4;
  query.fields = kDefaultFields | kFieldFlags;
  const BodyPair pairs[] = {{scene.find_body("table"), scene.find_body("arm/upper")},
                            {scene.find_body("table"), scene.find_body("arm/palm")}};
  query.pairs = pairs;
  query.all_pairs = false;
  const Answer a = evaluate(engine, query);
  const auto status = [&](int row) { return static_cast<Status>(a.view.status[row]); };
  EXPECT_EQ(status(0), Status::kOk);
  EXPECT_EQ(status(1), Status::kNoPose);
  EXPECT_EQ(status(2), Status::kBadPose);
  EXPECT_EQ(status(4), Status::kBadPose);
  EXPECT_LE(a.view.status[6], static_cast<std::uint8_t>(Status::kContact));
  EXPECT_TRUE(a.view.flags[6] & kFlagBeyondLimits);
  EXPECT_FALSE(a.view.flags[0] & kFlagBeyondLimits);
}

TEST(JointQuery, AJointThatItLeavesAsItIsMayBeTooOld) {
  engine::RobotOptions options = at_home();
  options.is_static = true;  // otherwise an unpublished base would be too old by itself
  const engine::Scene scene = arm_scene(options);
  engine::Engine engine(scene, test::kWithoutCovers);
  const JointPosition second[] = {{1, 0.2}};
  engine.set_joints(second);
  const std::uint32_t first = 0, third = 2;
  const double row[] = {0.5};
  const BodyPair pairs[] = {{scene.find_body("table"), scene.find_body("arm/palm")}};
  QueryView query;
  query.positions = row;
  query.configuration_count = 1;
  query.pairs = pairs;
  query.all_pairs = false;
  query.max_pose_age_ns = 1;  // that of joint2 is older by the time that the query begins
  query.joints = std::span(&third, 1);
  EXPECT_EQ(static_cast<Status>(evaluate(engine, query).view.status[0]), Status::kStalePose);
  const std::uint32_t both[] = {first, 1};
  const double rows[] = {0.5, 0.1};
  query.joints = both;
  query.positions = rows;
  const Answer fresh = evaluate(engine, query);
  EXPECT_LE(fresh.view.status[0], static_cast<std::uint8_t>(Status::kContact))
      << "the query says where all joints are that were ever set";
}

TEST(JointQuery, AnOlderSceneIsRejectedWhereItsJointsMeantAnother) {
  const TemporaryFolder folder;
  const auto add_frames = [&](engine::Scene& scene, const char* joint, double length, double upper) {
    scene.add_robot(
        "r", {.urdf = folder.write("r.urdf", std::string("<robot name='r'><link name='a'/><link name='b'/>") +
                                                 "<joint name='" + joint + "' type='revolute'><origin xyz='" +
                                                 std::to_string(length) +
                                                 " 0 0'/><parent link='a'/><child link='b'/><limit " +
                                                 "lower='-1' upper='" + std::to_string(upper) + "'/></joint></robot>"),
              .home = {{}}});
  };
  engine::Scene bodies;
  bodies.add_box("box", {1, 1, 1}, {.pose = Pose{{5, 0, 0}}});
  bodies.add_sphere("held", 0.1, {.pose = Pose{}});
  engine::Scene first = bodies;
  add_frames(first, "j", 1, 1);
  first.set_parent("held", "r/b");
  const std::uint32_t joint = 0;
  const double row[] = {0.5};
  const BodyPair pair[] = {{0, 1}};
  QueryView query;
  query.joints = std::span(&joint, 1);
  query.positions = row;
  query.configuration_count = 1;
  query.pairs = pair;
  query.all_pairs = false;
  query.scene_revision = first.revision();
  const engine::Engine old(first);
  for (const auto& [name, length, upper, means_the_same] :
       {std::tuple("j", 1.0, 1.0, true), std::tuple("k", 1.0, 1.0, false), std::tuple("j", 2.0, 1.0, false),
        std::tuple("j", 1.0, 0.5, false)}) {
    engine::Scene second = bodies;
    add_frames(second, name, length, upper);
    second.set_parent("held", "r/b");
    second.add_sphere("more", 0.1, {.pose = Pose{}});
    engine::Engine engine(second);
    engine.take_poses(old);
    ASSERT_NE(engine.scene_revision(), first.revision());
    EXPECT_EQ(error_text<engine::QueryError>([&] { engine.size(query); }).empty(), means_the_same)
        << name << " " << length;
    EXPECT_EQ(engine.joints_still_mean(first.revision(), std::span(&joint, 1)), means_the_same);
  }
}

}  // namespace
}  // namespace clearance
