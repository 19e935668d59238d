// Requests to the daemon other than distance queries.
#include <gtest/gtest.h>

#include <map>

#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

TEST_F(LoopTest, DescribesItsScene) {
  start(small_scene());
  const auto frame = evaluate(a_, simple_frame(FrameType::kDescribe, 4));
  ASSERT_EQ(frame->type(), FrameType::kScene);
  EXPECT_EQ(frame->header().request_id, 4u);
  EXPECT_EQ(frame->header().scene_revision, engine_->scene_revision());
  const auto scene = wire::parse_scene(frame->body());
  ASSERT_EQ(scene.bodies.size(), 4u);
  EXPECT_EQ(wire::name_of(scene.bodies[2].name), "link1");
  EXPECT_EQ(scene.bodies[0].is_static, 1);
  EXPECT_EQ(scene.bodies[0].vertex_count, 8u);
  EXPECT_NEAR(scene.bodies[2].extent, 0.25, 1e-9);
  EXPECT_EQ(scene.bodies[1].parent, kNone);
  EXPECT_EQ(scene.header.pair_count, 6u);
  EXPECT_EQ(wire::name_of(scene.groups[0].name), "arm");
  EXPECT_EQ(scene.groups[0].member_count, 2u);
  EXPECT_EQ(scene.members[1], 3u);
}

TEST_F(LoopTest, SetsPosesAndReportsTheirResults) {
  start(small_scene());
  wire::PosesHeader header;
  header.count = 4;
  header.stamp_ns = 77;
  header.sequence = 5;
  wire::FrameBuilder frame(wire::make_header(FrameType::kSetPoses, 1, 0, engine_->scene_revision()));
  frame.add(header)
      .add(wire::PoseRecord{3, 0, {0, 0, 2, 1, 0, 0, 0}})
      .add(wire::PoseRecord{1, 0, {0, 0, 0, 0, 0, 0, 0}})  // no rotation
      .add(wire::PoseRecord{0, 0, {0, 0, 1, 1, 0, 0, 0}})  // static
      .add(wire::PoseRecord{99, 0, {0, 0, 1, 1, 0, 0, 0}});
  const auto done = wire::parse_poses_done(evaluate(a_, frame.take())->body());
  EXPECT_EQ(done.applied, 1u);
  EXPECT_EQ(done.bad, 1u);
  EXPECT_EQ(done.fixed, 1u);
  EXPECT_EQ(done.unknown, 1u);
  EXPECT_EQ(done.revision, engine_->pose_revision());

  const auto states = wire::parse_states(evaluate(a_, simple_frame(FrameType::kGetStates, 2))->body());
  ASSERT_EQ(states.states.size(), 4u);
  EXPECT_EQ(states.states[3].pose[2], 2);
  EXPECT_EQ(states.states[3].stamp_ns, 77);
  EXPECT_GT(states.states[3].receipt_ns, 0);
  EXPECT_LE(states.states[3].receipt_ns, states.header.now_ns);
  EXPECT_EQ(states.states[1].status, static_cast<std::uint8_t>(Status::kBadPose));
  EXPECT_EQ(states.header.revision, done.revision);

  const Result reply = evaluate(a_, TestQuery());
  EXPECT_EQ(reply.snapshot_revision(), done.revision);
  EXPECT_EQ(reply.snapshot_stamp_ns(), 77);
  EXPECT_EQ(reply.snapshot_sequence(), 5);
  EXPECT_GE(reply.pose_age_ns(), 0);
  EXPECT_EQ(reply.status()[0], Status::kBadPose);  // table, cup
}

TEST_F(LoopTest, AQuerySeesThePosesOfItsArrival) {
  start(scattered_scene(60), short_slices());
  TestQuery query = large_query(60);
  query.header.fields |= kFieldPair;
  const Result before = evaluate(a_, query);
  transport_->send(a_, query.frame(1));
  for (int i = 0; i < 3; ++i) loop_->turn();
  ASSERT_TRUE(a_.replies.empty());
  const BodyPose moved{0, Pose{{500, 0, 0}}};
  loop_->on_poses(std::span(&moved, 1), 0);
  turn_until_idle();
  const Result during = result_of(take(a_));
  EXPECT_EQ(during.snapshot_revision(), before.snapshot_revision());
  EXPECT_EQ(std::memcmp(during.lower().data(), before.lower().data(), 8 * before.rows()), 0);
}

TEST_F(LoopTest, AttachmentsChangeTheScene) {
  start(small_scene());
  wire::AttachRecord record;
  record.child = 1;
  record.parent = 2;
  const auto attach = [&](std::uint64_t revision) {
    return wire::FrameBuilder(wire::make_header(FrameType::kAttach, 1, 0, revision)).add(record).take();
  };
  const std::uint64_t old_revision = engine_->scene_revision();
  const auto done = wire::parse_poses_done(evaluate(a_, attach(old_revision))->body());
  EXPECT_NE(done.scene_revision, old_revision);
  EXPECT_EQ(done.scene_revision, engine_->scene_revision());
  const auto scene_frame = evaluate(a_, simple_frame(FrameType::kDescribe, 1));
  const auto scene = wire::parse_scene(scene_frame->body());
  EXPECT_EQ(scene.bodies[1].parent, 2u);
  EXPECT_EQ(scene.header.pair_count, 5u) << "a body and the one it follows are no pair";
  EXPECT_EQ(error_of(evaluate(a_, attach(old_revision))).header.code,
            static_cast<std::uint16_t>(ErrorCode::kWrongScene));
}

TEST_F(LoopTest, AnAttachmentRejectsThoseAloneWhomItConcerns) {
  start(scattered_scene(6));  // body0 to body5
  wire::AttachRecord record;
  record.child = 1;
  record.parent = 2;
  const std::uint64_t old_revision = engine_->scene_revision();
  evaluate(a_, simple_frame(FrameType::kAttach, 1, std::as_bytes(std::span(&record, 1))));
  ASSERT_NE(engine_->scene_revision(), old_revision);
  const auto answered = [&](TestQuery query, std::uint64_t revision) {
    query.scene_revision = revision;
    const auto frame = evaluate(b_, query.frame(1));
    if (frame->type() != FrameType::kReply) {
      EXPECT_EQ(static_cast<ErrorCode>(error_of(frame).header.code), ErrorCode::kWrongScene);
      return false;
    }
    return wire::parse_reply(frame->body()).scene_revision == revision;
  };
  TestQuery others, both, moved, carrier, all, nearest;
  others.pairs = {{0, 3}, {4, 5}};
  both.pairs = {{1, 2}};  // an explicit pair stays, enabled or not
  moved.pairs = {{1, 3}};
  moved.bodies = {1};  // their poses are now relative to another body
  moved.configurations = {{0, 0, 0, 1, 0, 0, 0}};
  carrier = moved;
  carrier.bodies = {2};
  nearest.pairs = {{0, 3}};
  nearest.header.reduce = static_cast<std::uint8_t>(Reduce::kNearest);
  for (const auto& [query, stays] :
       {std::pair(others, true), {both, true}, {moved, false}, {carrier, true}, {all, false}, {nearest, true}}) {
    EXPECT_EQ(answered(query, old_revision), stays);
    EXPECT_TRUE(answered(query, engine_->scene_revision()));
    EXPECT_FALSE(answered(query, old_revision + 1)) << "a revision that never was";
  }
  const auto pose_of_body = [&](std::uint32_t body) {
    const wire::PosesHeader head{.count = 1};
    wire::PoseRecord pose;
    pose.body = body;
    pose.pose[3] = 1;
    return evaluate(b_, wire::FrameBuilder(wire::make_header(FrameType::kSetPoses, 1, 0, old_revision))
                            .add(head)
                            .add(pose)
                            .take())
        ->type();
  };
  EXPECT_EQ(pose_of_body(1), FrameType::kError) << "X_wb is not X_pb";
  EXPECT_EQ(pose_of_body(2), FrameType::kPosesDone);
  EXPECT_EQ(pose_of_body(3), FrameType::kPosesDone);
  record.child = 4;
  record.parent = 5;
  const auto done =
      evaluate(b_, wire::FrameBuilder(wire::make_header(FrameType::kAttach, 1, 0, old_revision)).add(record).take());
  ASSERT_EQ(done->type(), FrameType::kPosesDone);
  EXPECT_EQ(wire::parse_poses_done(done->body()).scene_revision, old_revision)
      << "it does not know what the first one did";
}

TEST_F(LoopTest, ReturnsTheOrderOfPairs) {
  start(small_scene());
  TestQuery query;
  query.pairs = {{kGroupBit | 0u, 0}, {2, 1}};
  const auto frame = evaluate(a_, query.frame(1, FrameType::kPairs));
  ASSERT_EQ(frame->type(), FrameType::kPairTable);
  const auto table = wire::parse_pair_table(frame->body());
  EXPECT_EQ(table.header.scene_revision, engine_->scene_revision());
  query.header.fields |= kFieldPair;
  const Result reply = evaluate(a_, query);
  ASSERT_EQ(table.pairs.size(), 3u);
  ASSERT_EQ(reply.rows(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(table.pairs[i].a, reply.pair()[i][0]);
    EXPECT_EQ(table.pairs[i].b, reply.pair()[i][1]);
  }
  // With moved bodies but no configurations: all pairs that include one.
  TestQuery moved;
  moved.bodies = {1};
  moved.configurations = {{0, 0, 0, 1, 0, 0, 0}};
  const auto moved_frame = evaluate(a_, moved.frame(2, FrameType::kPairs));
  EXPECT_EQ(wire::parse_pair_table(moved_frame->body()).pairs.size(), 3u);
}

TEST_F(LoopTest, AQueryThatRepeatsReusesItsJob) {
  start(small_scene());
  a_.sees_end = true;
  const auto at = [](double z) {
    TestQuery query;
    query.bodies = {1};
    query.configurations = {{0, 0, z, 1, 0, 0, 0}};
    return query;
  };
  const auto reused = [&] {
    for (const auto& [name, value] : engine_->stats())
      if (name == "engine.jobs_reused") return value;
    return ~std::uint64_t{0};
  };
  const Result low = evaluate(a_, at(0.3));
  EXPECT_EQ(reused(), 0u);
  const Result high = evaluate(a_, at(0.5));
  EXPECT_EQ(reused(), 1u);
  const Result fresh = evaluate(b_, at(0.5));  // of a client whose queries are not kept
  EXPECT_EQ(reused(), 1u);
  EXPECT_NE(high.lower()[0], low.lower()[0]);
  EXPECT_EQ(high.lower()[0], fresh.lower()[0]);
  EXPECT_EQ(high.upper()[0], fresh.upper()[0]);
}

TEST_F(LoopTest, EchoesAndCounts) {
  start(small_scene());
  const std::vector<std::byte> payload{std::byte{1}, std::byte{2}, std::byte{3}};
  const auto echo = evaluate(a_, simple_frame(FrameType::kPing, 8, payload));
  EXPECT_EQ(echo->type(), FrameType::kPong);
  EXPECT_TRUE(std::equal(payload.begin(), payload.end(), echo->body().begin(), echo->body().end()));
  evaluate(a_, small_query());
  evaluate(a_, simple_frame(FrameType::kDescribe, 1, payload));  // rejected, because it has a payload

  const auto frame = evaluate(a_, simple_frame(FrameType::kGetStats, 9));
  std::map<std::string, std::uint64_t> stats;
  const auto counters = wire::parse_stats(frame->body());
  for (std::uint64_t i = 0; i < counters.size(); ++i) stats[wire::name_of(counters[i].name)] = counters[i].value;
  EXPECT_EQ(stats.at("frames"), 4u);
  EXPECT_EQ(stats.at("memory.frames"), 3u) << "those of finished polls";
  EXPECT_EQ(stats.at("queries"), 1u);
  EXPECT_EQ(stats.at("queries.answered"), 1u);
  EXPECT_EQ(stats.at("rows"), 1u);
  EXPECT_EQ(stats.at("errors"), 1u);
  EXPECT_EQ(stats.at("errors.bad_frame"), 1u);
  EXPECT_EQ(stats.at("engine.bodies"), 4u);
}

}  // namespace
}  // namespace clearance
