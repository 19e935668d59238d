// Robots through the daemon: joint positions, queries in joint space, and rejections.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <vector>

#include "tests/server/core/loop_fixture.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

/// 0 table, 1 the arm's base, then its links.
engine::Scene arm_scene() {
  engine::Scene scene;
  engine::Scene::BodyOptions table = at(0.5, 0, -0.1);
  table.is_static = true;
  scene.add_box("table", {1, 1, 0.1}, table);
  scene.add_robot("arm", {.urdf = source_file("tests/engine/robot/arm.urdf"), .home = {{{"joint4", -1.5}}}});
  return scene;
}

class JointsTest : public LoopTest {
 protected:
  static std::vector<std::byte> update(std::initializer_list<wire::JointRecord> joints, std::int64_t stamp_ns = 0,
                                       std::uint64_t scene_revision = 0) {
    wire::PosesHeader header;
    header.count = joints.size();
    header.stamp_ns = stamp_ns;
    header.sequence = stamp_ns / 1000;
    wire::FrameBuilder frame(wire::make_header(FrameType::kSetJoints, 1, 0, scene_revision));
    frame.add(header);
    for (const wire::JointRecord& joint : joints) frame.add(joint);
    return frame.take();
  }
  wire::JointsParts joints() {
    frame_ = evaluate(a_, simple_frame(FrameType::kGetJoints, 3));
    EXPECT_EQ(frame_->type(), FrameType::kJoints);
    return wire::parse_joints(frame_->body());
  }
  static TestQuery joint_query() {
    TestQuery query;
    query.joints = {0, 3};
    query.positions = {0.1, -1.0, 0.2, -1.2, 0.3, -0.5};
    query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
    return query;
  }
  std::unique_ptr<MemoryFrame> frame_;
};

TEST_F(JointsTest, PositionsAreSetInOneRevisionAndListed) {
  start(arm_scene());
  const std::uint64_t before = engine_->pose_revision();
  const auto done = wire::parse_poses_done(
      evaluate(a_, update({{0, 0, 0.5}, {4, 0, std::numeric_limits<double>::quiet_NaN()}, {99, 0, 1}}, 77000))->body());
  EXPECT_EQ(done.applied, 1u);
  EXPECT_EQ(done.bad, 1u);
  EXPECT_EQ(done.unknown, 1u);
  EXPECT_EQ(done.revision, before + 1);
  const auto parts = joints();
  ASSERT_EQ(parts.joints.size(), 8u);
  const wire::JointStateRecord first = parts.joints[0], bad = parts.joints[4];
  EXPECT_EQ(wire::name_of(first.name), "arm/joint1");
  EXPECT_EQ(first.position, 0.5);
  EXPECT_EQ(first.lower, -2.9);
  EXPECT_EQ(first.stamp_ns, 77000);
  EXPECT_GT(first.receipt_ns, 0);
  EXPECT_EQ(bad.status, static_cast<std::uint8_t>(Status::kBadPose));
  ASSERT_EQ(parts.groups.size(), 1u);
  EXPECT_EQ(wire::name_of(parts.groups[0].name), "arm");
  EXPECT_EQ(parts.groups[0].member_count, 8u);
}

TEST_F(JointsTest, AnswersAreThoseOfTheEngine) {
  start(arm_scene());
  const TestQuery query = joint_query();
  const Result reply = evaluate(a_, query);
  QueryView view;
  view.joints = query.joints;
  view.positions = query.positions;
  view.configuration_count = 3;
  view.reduce = Reduce::kMin;
  double lower[3], upper[3];
  ReplyView columns;
  columns.lower = lower;
  columns.upper = upper;
  Job job = engine_->start(view, columns);
  while (!job.advance()) {
  }
  ASSERT_EQ(reply.rows(), 3u);
  EXPECT_EQ(reply.configurations(), 3u);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(reply.lower()[k], lower[k]);
    EXPECT_EQ(reply.upper()[k], upper[k]);
  }
}

class FreeScaleTest : public JointsTest {
 protected:
  static TestQuery scale_query() {
    TestQuery query = joint_query();
    query.weights = {1, 0.5};
    query.pairs = {{0, 6}, {0, 8}, {0, 10}, {2, 10}};  // the table, the base; forearm, palm, flange
    query.header.reduce = static_cast<std::uint8_t>(Reduce::kAny);
    query.header.fields = kFieldFreeScale;
    return query;
  }
  static QueryView view_of(const TestQuery& query) {
    QueryView view;
    view.joints = query.joints;
    view.positions = query.positions;
    view.configuration_count = static_cast<std::uint32_t>(query.positions.size() / query.joints.size());
    view.all_pairs = false;
    view.pairs = {reinterpret_cast<const BodyPair*>(query.pairs.data()), query.pairs.size()};
    return view;
  }
  std::string rejection(const TestQuery& query) { return error_of(evaluate(a_, query.frame(4))).text; }
};

TEST_F(FreeScaleTest, IsThatOfTheEngine) {
  start(arm_scene());
  const TestQuery query = scale_query();
  const std::vector<double> expected = engine_->free_scale(view_of(query), query.weights);
  const Result reply = evaluate(a_, query);
  ASSERT_EQ(reply.rows(), 3u);
  EXPECT_EQ(reply.fields(), kFieldFreeScale | kFieldPair);
  for (int k = 0; k < 3; ++k) {
    EXPECT_GT(expected[k], 0);
    EXPECT_EQ(reply.free_scale()[k], expected[k]);
    // Without the limiting pair the scale is larger.
    std::vector<BodyPair> others;
    for (const BodyPair pair : engine_->pairs(view_of(query)))
      if (pair.a != reply.pair()[k][0] || pair.b != reply.pair()[k][1]) others.push_back(pair);
    QueryView without = view_of(query);
    without.pairs = others;
    EXPECT_GT(engine_->free_scale(without, query.weights)[k], expected[k]);
  }
}

TEST_F(FreeScaleTest, IsNoWorkForTheLoop) {
  start(arm_scene(), short_slices());
  TestQuery query = joint_query();
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kAny);
  const auto is_elsewhere = [&](const TestQuery& requested) {
    transport_->send(a_, requested.frame(1));
    loop_->turn();
    const bool found = loop_->is_working();
    turn_until_idle();
    EXPECT_EQ(take(a_)->type(), FrameType::kReply);
    return found;
  };
  EXPECT_FALSE(is_elsewhere(query)) << "small";
  EXPECT_TRUE(is_elsewhere(scale_query()));
}

TEST_F(JointsTest, TheLoopAnswersTheNearestPairsAndRowsOfSecondOrderOfFewParts) {
  engine::Scene scene = arm_scene();
  Body many;
  many.name = "many";
  for (int i = 0; i < 1025; ++i)
    many.parts.push_back(make_convex_part({{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}}));
  many.pose = Pose{{0, 5, 0}};
  const std::uint32_t wide = scene.add_body(std::move(many));
  Loop::Options options;
  options.slice = 1h;  // a query that begins on the loop ends in the same turn
  start(std::move(scene), options);
  const auto is_elsewhere = [&](std::uint32_t fields, std::uint32_t k,
                                std::vector<std::array<std::uint32_t, 2>> pairs = {{0, 6}, {0, 8}}) {
    TestQuery query = joint_query();
    query.pairs = std::move(pairs);
    query.header.fields = fields;
    query.header.reduce = static_cast<std::uint8_t>(k ? Reduce::kNearest : Reduce::kMin);
    if (k) wire::append_record(query.records, 17, wire::kRecordRequired, std::as_bytes(std::span(&k, 1)));
    transport_->send(a_, query.frame(1));
    loop_->turn();
    const bool found = loop_->is_working();
    turn_until_idle();
    const auto reply = take(a_);
    EXPECT_EQ(reply->type(), FrameType::kReply) << wire::parse_error(reply->body()).text;
    return found;
  };
  EXPECT_FALSE(is_elsewhere(kFieldLower, 0));
  EXPECT_FALSE(is_elsewhere(kFieldLower, 2));
  for (const std::uint32_t field : {kFieldRate, kFieldHessianJoints, kFieldCurvature}) {
    EXPECT_FALSE(is_elsewhere(field, 0)) << field;
    EXPECT_FALSE(is_elsewhere(field, 2)) << field;
    EXPECT_EQ(is_elsewhere(field, 0, {{wide, 6}}), field != kFieldRate) << field << ", many parts";
  }
  EXPECT_TRUE(is_elsewhere(kFieldSmoothRadius, 0));
}

TEST_F(FreeScaleTest, OfWhatNothingMovesIsInfinite) {
  start(arm_scene());
  TestQuery query = scale_query();
  query.pairs = {{0, 2}};  // the table and the base
  const auto frame = evaluate(a_, query.frame(1));
  ASSERT_EQ(frame->type(), FrameType::kReply) << error_of(frame).text;
  const Result reply = evaluate(a_, query);
  EXPECT_EQ(reply.free_scale()[2], std::numeric_limits<double>::infinity());
  EXPECT_EQ(reply.pair()[2], (IdPair{kNone, kNone}));
}

TEST_F(FreeScaleTest, WhatItIsNotForIsReported) {
  start(arm_scene());
  TestQuery query = scale_query();
  query.weights = {1};
  EXPECT_EQ(rejection(query), "free_scale: weights: expected 2 numbers, one for each joint, got 1");
  query.weights = {1, -2};
  EXPECT_EQ(rejection(query), "free_scale: weights[1]: expected a finite number >= 0, got -2.000000");
  query.weights = {std::numeric_limits<double>::quiet_NaN(), 1};
  EXPECT_EQ(rejection(query), "free_scale: weights[0]: expected a finite number >= 0, got nan");
  query.weights = {};
  EXPECT_EQ(rejection(query), "free_scale: weights: expected 2 numbers, one for each joint, got 0");
  query = scale_query();
  query.header.fields = kFieldStatus;
  EXPECT_EQ(rejection(query), "weights: only for the column free_scale");
  query.header.fields = kFieldFreeScale | kFieldStatus;
  EXPECT_EQ(rejection(query), "fields: free_scale can be combined only with pair");
  query = scale_query();
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  EXPECT_EQ(rejection(query), "fields: free_scale needs reduce any");
  query = scale_query();
  query.joints = {};
  query.positions = {};
  EXPECT_EQ(rejection(query), "free_scale: expected joints, and their positions");
  query = scale_query();
  const std::uint32_t max_evaluations = 64;
  wire::append_record(query.records, 10, wire::kRecordRequired, std::as_bytes(std::span(&max_evaluations, 1)));
  query.positions.resize(4);
  EXPECT_EQ(rejection(query), "fields: motions have no free_scale");
}

// The links of a motion are placed in one step, so that of many links is answered by a worker.
TEST_F(JointsTest, AMotionOfManyLinksIsAnsweredElsewhere) {
  with_worker_ = true;
  for (const std::uint32_t arms : {10u, 40u}) {  // of 9 links
    engine::Scene scene;
    scene.add_box("table", {1, 1, 0.1}, at(0.5, 0, -0.1));
    for (std::uint32_t i = 0; i < arms; ++i)
      scene.add_robot("arm" + std::to_string(i),
                      {.urdf = source_file("tests/engine/robot/arm.urdf"), .home = {{{"joint4", -1.5}}}});
    start(std::move(scene));
    TestQuery query;
    query.pairs = {{0, engine_->scene().find_body("arm0/palm")}};
    for (std::uint32_t i = 0; i < arms; ++i) query.joints.push_back(8 * i);
    query.positions.assign(arms, 0.0);
    query.positions.resize(2 * std::size_t{arms}, 0.1);
    const std::uint32_t max_evaluations = 256;
    wire::append_record(query.records, 10, wire::kRecordRequired, std::as_bytes(std::span(&max_evaluations, 1)));
    transport_->send(a_, query.frame(1));
    while (a_.replies.empty()) loop_->turn();
    auto frame = take(a_);
    ASSERT_EQ(frame->type(), FrameType::kReply) << error_of(frame).text;
    EXPECT_EQ(result_of(std::move(frame)).rows(), 1u);
    if (arms == 10)
      EXPECT_GT(loop_->counter("loop.longest_section_units"), 64u);
    else
      EXPECT_LT(loop_->counter("loop.longest_section_units"), 16u);
  }
}

// A column as wide as the number of joints, between others, with fewer rows than reserved.
TEST_F(JointsTest, GradientsByJointsAreThoseOfTheEngine) {
  start(arm_scene());
  TestQuery query = joint_query();
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kWithin);
  query.header.max_distance = 0.3;
  query.header.fields = kDefaultFields | kFieldNormal | kFieldGradientJoints | kFieldPairLower;
  const Result reply = evaluate(a_, query);
  QueryView view;
  view.joints = query.joints;
  view.positions = query.positions;
  view.configuration_count = 3;
  view.reduce = Reduce::kWithin;
  view.max_distance = 0.3;
  view.fields = query.header.fields;
  const QuerySize size = engine_->size(view);
  std::vector<double> slopes(size.rows * 2);
  std::vector<BodyPair> pairs(size.rows);
  ReplyView columns;
  columns.gradient_joints = slopes.data();
  columns.pair_lower = pairs.data();
  columns.joints = size.joints;
  Job job = engine_->start(view, columns);
  while (!job.advance()) {
  }
  ASSERT_GT(reply.rows(), 2u);
  ASSERT_LT(reply.rows(), size.rows);
  ASSERT_EQ(reply.rows(), job.info().rows);
  EXPECT_EQ(reply.joints(), 2u);
  ASSERT_EQ(reply.gradient_joints().size(), 2 * reply.rows());
  EXPECT_EQ(std::memcmp(reply.gradient_joints().data(), slopes.data(), 16 * reply.rows()), 0);
  EXPECT_EQ(std::memcmp(reply.pair_lower().data(), pairs.data(), 8 * reply.rows()), 0);
  TestQuery without;
  without.header.fields = query.header.fields;
  EXPECT_EQ(error_of(evaluate(a_, without.frame(4))).text, "fields: gradient_joints is for a query with joints");
}

TEST_F(JointsTest, ItsPairsAreThoseOfTheLinksThatMove) {
  start(arm_scene());
  TestQuery last;
  last.joints = {6};
  const auto frame = evaluate(a_, last.frame(1, FrameType::kPairs));
  ASSERT_EQ(frame->type(), FrameType::kPairTable);
  const auto table = wire::parse_pair_table(frame->body());
  const std::uint32_t spin = engine_->scene().find_body("arm/spin");
  ASSERT_GT(table.pairs.size(), 5u);
  for (std::uint64_t i = 0; i < table.pairs.size(); ++i)
    EXPECT_TRUE(table.pairs[i].a >= spin || table.pairs[i].b >= spin) << "only what follows joint7";
}

TEST_F(JointsTest, AQueryWaitsForTheStampOfALink) {
  start(arm_scene());
  TestQuery query = joint_query();
  query.joints.clear();
  query.positions.clear();
  query.header.min_pose_stamp_ns = 5000;
  query.header.deadline_ns = 10'000'000'000;
  query.header.wait_for = engine_->scene().find_body("arm/palm");
  evaluate(a_, update({{0, 0, 0.1}, {1, 0, 0.1}}, 1000));  // gives the palm a stamp
  transport_->send(a_, query.frame(9));
  turn_until_idle();
  EXPECT_TRUE(a_.replies.empty());
  evaluate(b_, update({{0, 0, 0.2}}, 5000));
  turn_until_idle();
  EXPECT_TRUE(a_.replies.empty()) << "joint2 is as old as before";
  evaluate(b_, update({{1, 0, 0.2}}, 6000));
  turn_until_idle();
  ASSERT_EQ(a_.replies.size(), 1u);
  EXPECT_EQ(take(a_)->type(), FrameType::kReply);
}

TEST_F(JointsTest, WhatIsWrongIsRejectedAndNamed) {
  start(arm_scene());
  const auto rejected = [&](std::vector<std::byte> frame, ErrorCode code, const std::string& text) {
    const auto error = error_of(evaluate(a_, std::move(frame)));
    EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(code));
    EXPECT_EQ(error.text, text);
  };
  rejected(update({{2, 0, 0.1}, {2, 0, 0.2}}), ErrorCode::kBadQuery, "joints: 'arm/joint3' is named twice");
  const std::uint64_t revision = engine_->scene_revision();
  rejected(update({{2, 0, 0.1}}, 0, revision + 1), ErrorCode::kWrongScene,
           "the request is for scene revision " + std::to_string(revision + 1) + ", the daemon's is " +
               std::to_string(revision) + ": fetch the scene again");
  evaluate(a_, update({{2, 0, 0.1}}, 5000));
  rejected(update({{2, 0, 0.1}}, 4000), ErrorCode::kBadQuery,
           "stamp_ns: 4000 is older than 5000, the last from this publisher for 'arm/joint3'");
  TestQuery query = joint_query();
  query.joints = {0, 0};
  rejected(query.frame(1), ErrorCode::kBadQuery, "joints[1]: 'arm/joint1' is named twice");
  query.joints = {0, 12};
  rejected(query.frame(1), ErrorCode::kBadQuery, "joints[1]: unknown joint 12; the scene has 8");
  query = joint_query();
  query.positions.pop_back();
  rejected(query.frame(1), ErrorCode::kBadQuery,
           "query: positions (record 9) has 5 numbers, expected 2 configurations of 2 joints");
  query.positions.clear();
  rejected(query.frame(1), ErrorCode::kBadQuery, "query: 2 joints, and no configurations of them");
  query = joint_query();
  query.header.configuration_count = 3;
  query.joints.clear();
  query.positions = {1};
  const std::byte odd[3] = {};
  TestQuery cut;
  wire::append_record(cut.records, 8, wire::kRecordRequired, odd);
  rejected(cut.frame(1), ErrorCode::kBadFrame, "query: joints (record 8) has 3 bytes, expected a multiple of 4");
  wire::PoseRecord link;
  link.body = engine_->scene().find_body("arm/fore");
  link.pose[3] = 1;
  wire::PosesHeader header;
  header.count = 1;
  rejected(wire::FrameBuilder(wire::make_header(FrameType::kSetPoses, 1, 0)).add(header).add(link).take(),
           ErrorCode::kBadQuery,
           "poses: 'arm/fore' is a link placed by joints: set their positions, or the pose of its robot's base");
}

TEST_F(JointsTest, AnAttachmentLeavesJointIdsWhatTheyAre) {
  engine::Scene scene = arm_scene();
  scene.add_sphere("cup", 0.05, at(1, 1, 1));
  const std::uint32_t cup = scene.find_body("cup");
  start(std::move(scene));
  const std::uint64_t revision = engine_->scene_revision();
  const Pose held{{0, 0, 0.1}};
  engine_->attach(cup, engine_->scene().find_body("arm/palm"), &held);
  ASSERT_NE(engine_->scene_revision(), revision);
  EXPECT_EQ(evaluate(a_, update({{2, 0, 0.1}}, 0, revision))->type(), FrameType::kPosesDone);
}

}  // namespace
}  // namespace clearance
