// Queries that wait for poses: started once the poses exist, rejected after the timeout, without blocking others.
#include <gtest/gtest.h>

#include <thread>

#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

class DeferredQueries : public LoopTest {
 protected:
  static TestQuery waiting_query(std::int64_t stamp_ns, std::chrono::nanoseconds deadline,
                                 std::uint32_t wait_for = kEveryBody) {
    TestQuery query = small_query();
    query.header.min_pose_stamp_ns = stamp_ns;
    query.header.deadline_ns = deadline.count();
    query.header.wait_for = wait_for;
    return query;
  }
  void move(std::uint32_t body, std::int64_t stamp_ns, std::int64_t sequence = 0) {
    const BodyPose pose{body, Pose{{0, 0, 1e-3 * static_cast<double>(stamp_ns)}}};
    ASSERT_EQ(loop_->on_poses(std::span(&pose, 1), stamp_ns, sequence).applied, 1u);
  }
  /// Code and message of an error reply.
  std::pair<ErrorCode, std::string> rejection(MemoryClient& client) {
    const auto error = error_of(take(client));
    return {static_cast<ErrorCode>(error.header.code), error.text};
  }
};

TEST_F(DeferredQueries, BeginOnceThePosesAreThereAndDelayNoOthers) {
  start(small_scene());
  move(1, 90, 7);
  transport_->send(a_, waiting_query(100, 10s).frame(1));
  turn_until_idle();
  EXPECT_TRUE(a_.replies.empty());
  EXPECT_EQ(loop_->counter("queries.held_back"), 1u);
  EXPECT_EQ(evaluate(b_, small_query()).snapshot_stamp_ns(), 90) << "another is answered meanwhile";
  const Result own = evaluate(a_, small_query());
  EXPECT_EQ(own.snapshot_stamp_ns(), 90) << "and so is another query of the same client";
  move(1, 99, 8);
  turn_until_idle();
  EXPECT_TRUE(a_.replies.empty());
  move(1, 100, 9);
  loop_->turn();
  ASSERT_EQ(a_.replies.size(), 1u) << "in the turn after the poses came";
  const Result reply = result_of(take(a_));
  EXPECT_EQ(reply.snapshot_stamp_ns(), 100);
  EXPECT_EQ(reply.snapshot_sequence(), 9);
  EXPECT_GE(reply.pose_age_ns(), 0);
  EXPECT_LT(reply.pose_age_ns(), static_cast<std::int64_t>(reply.server_ns()))
      << "the query arrived before these poses";
  EXPECT_EQ(evaluate(a_, waiting_query(100, 10s)).snapshot_stamp_ns(), 100) << "no wait";
}

TEST_F(DeferredQueries, AreLetGoOfThoughAnotherIsHeldInTheTurnInWhichThePosesCame) {
  start(small_scene());
  transport_->send(a_, waiting_query(100, 10s).frame(1));
  turn_until_idle();
  ASSERT_EQ(loop_->held(), 1u);
  wire::PosesHeader header;
  header.count = 1;
  header.stamp_ns = 100;
  wire::FrameBuilder poses(wire::make_header(wire::FrameType::kSetPoses, 1, 0));
  poses.add(header).add(wire::PoseRecord{1, 0, {0, 0, 2, 1, 0, 0, 0}});
  transport_->send(c_, poses.take());
  transport_->send(b_, waiting_query(200, 10s).frame(1));
  loop_->turn();
  EXPECT_EQ(take(c_)->type(), wire::FrameType::kPosesDone);
  EXPECT_EQ(a_.replies.size(), 1u) << "its poses are there";
  EXPECT_EQ(loop_->held(), 1u);
  EXPECT_TRUE(b_.replies.empty());
}

TEST_F(DeferredQueries, AreRejectedWhenTimeIsUp) {
  start(small_scene());
  transport_->send(a_, waiting_query(100, 1ns).frame(2));
  transport_->send(b_, waiting_query(100, 10s).frame(3));
  loop_->turn();
  loop_->turn();
  EXPECT_EQ(rejection(a_),
            std::pair(ErrorCode::kPosesLate, std::string("no poses with stamp 100 or newer came within 0.000001 ms")));
  EXPECT_TRUE(b_.replies.empty());
  move(2, 101);
  loop_->turn();
  EXPECT_EQ(take(b_)->type(), FrameType::kReply);
  EXPECT_EQ(loop_->counter("errors.poses_late"), 1u);
}

TEST_F(DeferredQueries, ASleepingLoopWakesWhenTimeIsUp) {
  Loop::Options options;
  options.spin = 0ns;
  options.tick = 1h;  // nothing else would wake it
  start(small_scene(), options);
  std::thread server([&] { loop_->run(); });
  transport_->send(a_, waiting_query(100, 2ms).frame(1));
  transport_->wait_for_reply();
  loop_->stop();
  server.join();
  EXPECT_EQ(rejection(a_).first, ErrorCode::kPosesLate);
}

TEST_F(DeferredQueries, WaitForABodyAGroupOrAll) {
  Loop::Options options;
  options.tick = 0s;  // clients that are gone are noticed in the next turn
  start(small_scene(), options);
  constexpr std::uint32_t kCup = 1, kLink1 = 2, kLink2 = 3, kArm = kGroupBit | 0u;
  const auto is_there = [this](std::uint32_t who, std::int64_t stamp_ns) {
    transport_->send(a_, waiting_query(stamp_ns, 1h, who).frame(1));
    for (int i = 0; i < 3; ++i) loop_->turn();
    if (!a_.replies.empty()) return take(a_)->type() == FrameType::kReply;
    a_.alive = false;
    loop_->turn();
    EXPECT_EQ(loop_->held(), 0u);
    a_.alive = true;
    return false;
  };
  EXPECT_FALSE(is_there(kEveryBody, 1)) << "no pose has come";
  move(kCup, 50);
  move(kLink1, 100);
  EXPECT_TRUE(is_there(kCup, 50));
  EXPECT_FALSE(is_there(kCup, 51));
  EXPECT_TRUE(is_there(kArm, 100)) << "link2 never had a stamp";
  EXPECT_FALSE(is_there(kLink2, 1));
  move(kLink2, 80);
  EXPECT_FALSE(is_there(kArm, 100));
  EXPECT_TRUE(is_there(kArm, 80));
  EXPECT_FALSE(is_there(kEveryBody, 80)) << "the cup";
  EXPECT_TRUE(is_there(kEveryBody, 50));
}

TEST_F(DeferredQueries, WhatIsWrongIsReportedAtOnce) {
  start(small_scene());
  TestQuery query = waiting_query(100, 10s);
  query.pairs = {{1, 1}};
  EXPECT_EQ(error_of(evaluate(a_, query.frame(1))).header.code, static_cast<std::uint16_t>(ErrorCode::kBadQuery));
  for (const auto& [who, text] :
       {std::pair(9u, "wait_for: unknown body 9"), std::pair(kGroupBit | 5u, "wait_for: unknown group 5")})
    EXPECT_EQ(error_of(evaluate(a_, waiting_query(100, 10s, who).frame(1))).text, text);
  EXPECT_EQ(error_of(evaluate(a_, waiting_query(-1, 10s).frame(1))).text,
            "query: min_pose_stamp_ns must be >= 0, got -1");
}

TEST_F(DeferredQueries, CountAsUnderWayUntilTheirClientIsGone) {
  Loop::Options options;
  options.max_waiting_per_client = 2;
  options.tick = 0s;
  start(small_scene(), options);
  for (std::uint64_t i = 1; i <= 3; ++i) transport_->send(a_, waiting_query(100, 10s).frame(i));
  loop_->turn();
  EXPECT_EQ(rejection(a_).first, ErrorCode::kBusy);
  EXPECT_EQ(loop_->held(), 2u);
  EXPECT_EQ(a_.sinks, 2);
  a_.alive = false;
  loop_->turn();
  EXPECT_EQ(a_.sinks, 0);
  EXPECT_EQ(loop_->counter("queries.dropped"), 2u);
  a_.alive = true;
  EXPECT_EQ(evaluate(a_, small_query()).rows(), 1u) << "it may ask again";
}

TEST_F(DeferredQueries, CountAmongTheBytesOfTheirClientAndOfAll) {
  const std::vector<std::byte> frame = waiting_query(100, 10s).frame(1);
  const std::uint64_t bytes = frame.size() - sizeof(wire::FrameHeader);
  Loop::Options options;
  options.max_client_bytes = 3 * bytes / 2;
  start(small_scene(), options);
  for (MemoryClient* client : {&a_, &a_, &b_}) transport_->send(*client, frame);
  loop_->turn();
  EXPECT_EQ(loop_->held(), 2u);
  auto error = rejection(a_);
  EXPECT_EQ(error.first, ErrorCode::kBusy);
  EXPECT_NE(error.second.find("of this client under way take " + std::to_string(bytes) + " bytes"), std::string::npos)
      << error.second;
  move(1, 100);
  turn_until_idle();
  EXPECT_EQ(take(a_)->type(), FrameType::kReply);
  EXPECT_EQ(take(b_)->type(), FrameType::kReply);

  options = {};
  options.max_waiting_bytes = 3 * bytes / 2;
  start(small_scene(), options);
  for (MemoryClient* client : {&a_, &b_}) transport_->send(*client, frame);
  loop_->turn();
  EXPECT_EQ(loop_->held(), 1u);
  error = rejection(b_);
  EXPECT_EQ(error.first, ErrorCode::kBusy);
  EXPECT_NE(error.second.find("the requests and replies under way take " + std::to_string(bytes) + " bytes"),
            std::string::npos)
      << error.second;
  move(1, 100);
  turn_until_idle();
  EXPECT_EQ(take(a_)->type(), FrameType::kReply);
}

}  // namespace
}  // namespace clearance
