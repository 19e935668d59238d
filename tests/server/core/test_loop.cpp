// Queries through the loop: scheduling, replies, and rejections.
#include <gtest/gtest.h>

#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

TEST_F(LoopTest, AnswersAreTheEnginesBits) {
  start(scattered_scene(30), short_slices());
  TestQuery query = large_query(3);
  query.header.fields =
      kDefaultFields | kFieldPoints | kFieldNormal | kFieldFlags | kFieldPieces | kFieldPair | kFieldGradient;
  const Result reply = evaluate(a_, query);
  ASSERT_GT(reply.rows(), 1000u);

  QueryView direct;
  direct.fields = query.header.fields;
  direct.configuration_count = 40;
  direct.bodies = query.bodies;
  direct.configurations = {reinterpret_cast<const Pose*>(query.configurations.data()), query.configurations.size()};
  const QuerySize size = engine_->size(direct);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  const AlignedBytes columns = aligned_bytes(bytes);
  const ReplyView view = reply_view_over(columns.get(), size.rows, size.fields);
  Job job = engine_->start(direct, view);
  while (!job.advance()) {
  }
  ASSERT_EQ(reply.rows(), size.rows);
  EXPECT_EQ(reply.fields(), size.fields);
  EXPECT_EQ(std::memcmp(reply.lower().data(), view.lower, 8 * size.rows), 0);
  EXPECT_EQ(std::memcmp(reply.upper().data(), view.upper, 8 * size.rows), 0);
  EXPECT_EQ(std::memcmp(reply.status().data(), view.status, size.rows), 0);
  EXPECT_EQ(std::memcmp(reply.point_b().data(), view.point_b, 24 * size.rows), 0);
  EXPECT_EQ(std::memcmp(reply.gradient().data(), view.gradient, 96 * size.rows), 0);
  EXPECT_EQ(std::memcmp(reply.pair().data(), view.pair, 8 * size.rows), 0);
  EXPECT_EQ(reply.configurations(), 40u);
  EXPECT_EQ(reply.pairs(), size.pairs);
  EXPECT_EQ(reply.backend(), "cpu");
  EXPECT_EQ(reply.scene_revision(), engine_->scene_revision());
  EXPECT_GE(reply.server_ns(), reply.engine_ns());
  EXPECT_GT(reply.engine_ns(), 0u);
}

TEST_F(LoopTest, PayloadsNeedNoAlignment) {
  start(small_scene());
  TestQuery query = small_query();
  query.pairs = {{0, 1}, {1, 2}};
  query.bodies = {1};
  query.configurations = {{0, 0, 0.5, 1, 0, 0, 0}, {0, 0, 0.6, 1, 0, 0, 0}};
  const Result aligned = evaluate(a_, query);
  transport_->unaligned = true;
  const Result unaligned = evaluate(a_, query);
  ASSERT_EQ(aligned.rows(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(aligned.lower()[i], unaligned.lower()[i]);
  EXPECT_NEAR(unaligned.distance()[2], 0.45, 1e-6);
}

TEST_F(LoopTest, ASmallQueryOvertakesALargeOne) {
  start(scattered_scene(60), short_slices());
  transport_->send(a_, large_query(60).frame(1));
  for (int i = 0; i < 5; ++i) loop_->turn();
  ASSERT_TRUE(a_.replies.empty()) << "the large query must still be under way for this test to mean anything";
  transport_->send(b_, small_query().frame(1));
  loop_->turn();
  EXPECT_EQ(b_.replies.size(), 1u) << "a new query gets the very next slice";
  EXPECT_TRUE(a_.replies.empty());
  turn_until_idle();
  EXPECT_EQ(a_.replies.size(), 1u);
}

TEST_F(LoopTest, AnOwnSmallQueryOvertakesToo) {
  start(scattered_scene(60), short_slices());
  transport_->send(a_, large_query(60).frame(1));
  transport_->send(a_, small_query().frame(2));
  loop_->turn();
  loop_->turn();
  ASSERT_EQ(a_.replies.size(), 1u);
  EXPECT_EQ(a_.replies[0]->header().request_id, 2u);
}

TEST_F(LoopTest, EqualQueriesOfOneClientEndOneAfterTheOther) {
  start(scattered_scene(60), short_slices());
  for (std::uint64_t i = 1; i <= 3; ++i) transport_->send(a_, large_query(60).frame(i));
  int turns = 0, first_after = 0;
  while (a_.replies.size() < 3) {
    ASSERT_TRUE(loop_->turn());
    ++turns;
    if (a_.replies.size() == 1 && !first_after) first_after = turns;
  }
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(a_.replies[i]->header().request_id, i + 1);
  EXPECT_GT(turns, 30);
  EXPECT_LT(first_after, turns / 2) << "the first one does not share its time with the others";
}

TEST_F(LoopTest, ALargeQueryIsNotStarved) {
  start(scattered_scene(60), short_slices());
  transport_->send(a_, large_query(60).frame(1));
  int turns = 0;
  while (a_.replies.empty() && ++turns < 100000) {
    transport_->send(b_, small_query().frame(1));
    transport_->send(c_, small_query().frame(1));
    loop_->turn();
  }
  EXPECT_EQ(a_.replies.size(), 1u);
  EXPECT_GT(turns, 30) << "too small a query to tell";
}

TEST_F(LoopTest, AClientOfManyQueriesDelaysNoOther) {
  start(small_scene(), short_slices());
  for (int i = 0; i < 50; ++i) transport_->send(a_, small_query().frame(1));
  transport_->send(b_, small_query().frame(1));
  loop_->turn();
  loop_->turn();
  EXPECT_EQ(b_.replies.size(), 1u);
  EXPECT_EQ(a_.replies.size(), 1u);
  turn_until_idle();
  EXPECT_EQ(a_.replies.size(), 50u);
}

TEST_F(LoopTest, TooManyQueriesOfOneClientAreRejected) {
  Loop::Options options = short_slices();
  options.max_waiting_per_client = 3;
  start(small_scene(), options);
  for (std::uint64_t i = 1; i <= 5; ++i) transport_->send(a_, small_query().frame(i));
  transport_->send(b_, small_query().frame(9));
  loop_->turn();
  // Two rejections were sent at once, in addition to the answer to the first query.
  ASSERT_EQ(a_.replies.size(), 3u);
  EXPECT_EQ(a_.replies[0]->header().request_id, 4u);
  const auto error = error_of(a_.replies[0]);
  EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kBusy));
  EXPECT_EQ(error.text, "3 queries of this client are under way already; retry later (limit max-waiting)");
  turn_until_idle();
  EXPECT_EQ(a_.replies.size(), 5u);
  EXPECT_EQ(b_.replies.size(), 1u) << "another client is not concerned";
  a_.replies.clear();
  EXPECT_EQ(evaluate(a_, small_query()).rows(), 1u) << "and it may ask again";
}

TEST_F(LoopTest, RepliesUnderWayAreBoundedInBytes) {
  Loop::Options options = short_slices();
  options.max_waiting_bytes = 700;
  start(small_scene(), options);
  for (std::uint64_t i = 1; i <= 2; ++i) transport_->send(a_, small_query().frame(i));
  loop_->turn();
  turn_until_idle();
  ASSERT_EQ(a_.replies.size(), 2u);
  EXPECT_EQ(error_of(a_.replies[0]).text, "the requests and replies under way take 608 bytes already; retry later");
  EXPECT_EQ(a_.replies[1]->type(), FrameType::kReply);
}

TEST_F(LoopTest, QueriesOfAClientThatHasGoneAreDropped) {
  start(scattered_scene(60), short_slices());
  for (int i = 0; i < 3; ++i) transport_->send(a_, large_query(60).frame(1));
  transport_->send(b_, small_query().frame(1));
  for (int i = 0; i < 8; ++i) loop_->turn();
  EXPECT_EQ(loop_->waiting(), 3u);
  a_.alive = false;
  turn_until_idle();
  EXPECT_EQ(loop_->waiting(), 0u);
  EXPECT_TRUE(a_.replies.empty());
  EXPECT_EQ(a_.sinks, 0) << "their room was given back";
  EXPECT_EQ(loop_->counter("queries.dropped"), 3u);
  EXPECT_EQ(b_.replies.size(), 1u);
}

TEST_F(LoopTest, SparseRepliesAreClosedUp) {
  start(scattered_scene(40), short_slices());
  TestQuery query;
  query.header.fields = kDefaultFields | kFieldPoints | kFieldFlags;
  query.header.max_distance = 6;
  const Result dense = evaluate(a_, query);
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kWithin);
  const Result sparse = evaluate(a_, query);
  std::size_t near = 0;
  for (std::size_t i = 0; i < dense.rows(); ++i) {
    if (dense.status()[i] == Status::kBeyond) continue;
    ASSERT_LT(near, sparse.rows());
    EXPECT_EQ(dense.lower()[i], sparse.lower()[near]);
    EXPECT_EQ(dense.upper()[i], sparse.upper()[near]);
    EXPECT_EQ(dense.status()[i], sparse.status()[near]);
    EXPECT_EQ(dense.point_b()[3 * i + 2], sparse.point_b()[3 * near + 2]);
    ++near;
  }
  EXPECT_EQ(near, sparse.rows());
  EXPECT_EQ(sparse.total(), near);
  EXPECT_GT(near, 10u);
  EXPECT_LT(near, dense.rows() / 2) << "most of the room was not needed";

  // A client whose buffer fits the actual reply, but not the largest possible one.
  a_.room = sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader) +
            wire::columns_bytes(sparse.rows(), sparse.fields()) + wire::kEpochRecordBytes;
  const Result narrow = evaluate(a_, query);
  ASSERT_EQ(narrow.rows(), sparse.rows());
  EXPECT_EQ(std::memcmp(narrow.point_a().data(), sparse.point_a().data(), 24 * sparse.rows()), 0);
  --a_.room;
  const auto error = error_of(evaluate(a_, query.frame(1)));
  EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kTooLarge));
  EXPECT_EQ(error.header.needed_bytes, a_.room + 1);

  query.header.max_results = 5;
  a_.room = std::numeric_limits<std::uint64_t>::max();
  const Result few = evaluate(a_, query);
  EXPECT_EQ(few.rows(), 5u);
  EXPECT_EQ(few.total(), near);
}

TEST_F(LoopTest, WhatAClientCannotHoldIsReported) {
  start(small_scene());
  a_.room = 400;
  const auto error = error_of(evaluate(a_, small_query().frame(1)));
  EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kTooLarge));
  EXPECT_EQ(error.text, "the reply of 1 rows needs 464 bytes, more than this client has room for");
  EXPECT_EQ(error.header.needed_bytes, 464u);
  const auto scene = error_of(evaluate(a_, simple_frame(FrameType::kDescribe, 1)));
  EXPECT_EQ(scene.text, "the reply needs 744 bytes, more than this client has room for");
  a_.room = 10;
  transport_->send(a_, small_query().frame(1));
  turn_until_idle();
  EXPECT_TRUE(a_.replies.empty());
  EXPECT_EQ(loop_->counter("errors.unsent"), 1u);
}

/// A transport with every permitted failure.
class FailingTransport final : public Transport {
 public:
  std::string url() const override { return "failing://"; }
  std::vector<int> descriptors() const override { return {}; }
  int poll(RequestHandler&) override { throw std::runtime_error("the cable was cut"); }
  void tick(RequestHandler&) override { throw std::runtime_error("still cut"); }
};

TEST_F(LoopTest, AFailingTransportDoesNotStopTheOthers) {
  start(small_scene());
  loop_->add(std::make_unique<FailingTransport>());
  EXPECT_EQ(evaluate(a_, small_query()).rows(), 1u);
  EXPECT_GE(loop_->counter("errors.transport"), 2u);
}

}  // namespace
}  // namespace clearance
