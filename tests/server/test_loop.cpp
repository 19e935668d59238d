#include <gtest/gtest.h>

#include <thread>

#include "client/spin_gate.h"
#include "loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;
using namespace std::chrono_literals;

TEST(SpinGate, IsGivenUpWhereItDoesNotPayAndTriedAgain) {
  SpinGate gate;
  for (int i = 0; i < SpinGate::kMisses; ++i) {
    EXPECT_TRUE(gate.opens()) << i;
    gate.missed();
  }
  int opened = 0;
  for (unsigned i = 0; i < 10 * SpinGate::kProbeEvery; ++i)
    if (gate.opens()) ++opened, gate.missed();
  EXPECT_EQ(opened, 10) << "one wait of 64";
  while (!gate.opens()) {
  }
  gate.paid();
  EXPECT_TRUE(gate.opens());
  EXPECT_TRUE(gate.opens());
}

TEST_F(LoopTest, AnswersAreTheEnginesBits) {
  start(scattered_scene(30), short_slices());
  TestQuery query = large_query(3);
  query.header.fields =
      kDefaultFields | kFieldPoints | kFieldNormal | kFieldFlags | kFieldPieces | kFieldPair | kFieldGradient;
  const Reply reply = ask(a_, query);
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
  const Reply aligned = ask(a_, query);
  transport_->unaligned = true;
  const Reply unaligned = ask(a_, query);
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

TEST_F(LoopTest, TooManyQueriesOfOneClientAreRefused) {
  Loop::Options options = short_slices();
  options.max_waiting_per_client = 3;
  start(small_scene(), options);
  for (std::uint64_t i = 1; i <= 5; ++i) transport_->send(a_, small_query().frame(i));
  transport_->send(b_, small_query().frame(9));
  loop_->turn();
  // Two refusals came at once, besides the answer to the first query.
  ASSERT_EQ(a_.replies.size(), 3u);
  EXPECT_EQ(a_.replies[0]->header().request_id, 4u);
  const auto error = error_of(a_.replies[0]);
  EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kBusy));
  EXPECT_EQ(error.text, "3 queries of this client are under way already; ask again (--max-waiting)");
  turn_until_idle();
  EXPECT_EQ(a_.replies.size(), 5u);
  EXPECT_EQ(b_.replies.size(), 1u) << "another client is not concerned";
  a_.replies.clear();
  EXPECT_EQ(ask(a_, small_query()).rows(), 1u) << "and it may ask again";
}

TEST_F(LoopTest, RepliesUnderWayAreBoundedInBytes) {
  Loop::Options options = short_slices();
  options.max_waiting_bytes = 700;
  start(small_scene(), options);
  for (std::uint64_t i = 1; i <= 2; ++i) transport_->send(a_, small_query().frame(i));
  loop_->turn();
  turn_until_idle();
  ASSERT_EQ(a_.replies.size(), 2u);
  EXPECT_EQ(error_of(a_.replies[0]).text, "the requests and replies under way take 592 bytes already; ask again");
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
  const Reply dense = ask(a_, query);
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kWithin);
  const Reply sparse = ask(a_, query);
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

  // A client with no room for the most that might come back, but for what does.
  a_.room = sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader) + wire::columns_bytes(sparse.rows(), sparse.fields());
  const Reply narrow = ask(a_, query);
  ASSERT_EQ(narrow.rows(), sparse.rows());
  EXPECT_EQ(std::memcmp(narrow.point_a().data(), sparse.point_a().data(), 24 * sparse.rows()), 0);
  --a_.room;
  const auto error = error_of(ask(a_, query.frame(1)));
  EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kTooLarge));
  EXPECT_EQ(error.header.needed_bytes, a_.room + 1);

  query.header.max_results = 5;
  a_.room = std::numeric_limits<std::uint64_t>::max();
  const Reply few = ask(a_, query);
  EXPECT_EQ(few.rows(), 5u);
  EXPECT_EQ(few.total(), near);
}

TEST_F(LoopTest, WhatAClientHasNoRoomForIsSaid) {
  start(small_scene());
  a_.room = 400;
  const auto error = error_of(ask(a_, small_query().frame(1)));
  EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kTooLarge));
  EXPECT_EQ(error.text, "the reply of 1 rows needs 448 bytes, more than this client has room for");
  EXPECT_EQ(error.header.needed_bytes, 448u);
  const auto scene = error_of(ask(a_, simple_frame(FrameType::kDescribe, 1)));
  EXPECT_EQ(scene.text, "the reply needs 728 bytes, more than this client has room for");
  a_.room = 10;
  transport_->send(a_, small_query().frame(1));
  turn_until_idle();
  EXPECT_TRUE(a_.replies.empty());
  EXPECT_EQ(loop_->counter("errors.unsent"), 1u);
}

TEST_F(LoopTest, DescribesItsScene) {
  start(small_scene());
  const auto frame = ask(a_, simple_frame(FrameType::kDescribe, 4));
  ASSERT_EQ(frame->type(), FrameType::kScene);
  EXPECT_EQ(frame->header().request_id, 4u);
  EXPECT_EQ(frame->header().scene_revision, engine_->scene_revision());
  const auto scene = wire::parse_scene(frame->payload());
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

TEST_F(LoopTest, SetsPosesAndTellsWhatBecameOfThem) {
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
  const auto done = wire::parse_poses_done(ask(a_, frame.take())->payload());
  EXPECT_EQ(done.applied, 1u);
  EXPECT_EQ(done.bad, 1u);
  EXPECT_EQ(done.fixed, 1u);
  EXPECT_EQ(done.unknown, 1u);
  EXPECT_EQ(done.revision, engine_->pose_revision());

  const auto states = wire::parse_states(ask(a_, simple_frame(FrameType::kGetStates, 2))->payload());
  ASSERT_EQ(states.states.size(), 4u);
  EXPECT_EQ(states.states[3].pose[2], 2);
  EXPECT_EQ(states.states[3].stamp_ns, 77);
  EXPECT_GT(states.states[3].receipt_ns, 0);
  EXPECT_LE(states.states[3].receipt_ns, states.header.now_ns);
  EXPECT_EQ(states.states[1].status, static_cast<std::uint8_t>(Status::kBadPose));
  EXPECT_EQ(states.header.revision, done.revision);

  const Reply reply = ask(a_, TestQuery());
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
  const Reply before = ask(a_, query);
  transport_->send(a_, query.frame(1));
  for (int i = 0; i < 3; ++i) loop_->turn();
  ASSERT_TRUE(a_.replies.empty());
  const BodyPose moved{0, Pose{{500, 0, 0}}};
  loop_->on_poses(std::span(&moved, 1), 0);
  turn_until_idle();
  const Reply during(take(a_));
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
  const auto done = wire::parse_poses_done(ask(a_, attach(old_revision))->payload());
  EXPECT_NE(done.scene_revision, old_revision);
  EXPECT_EQ(done.scene_revision, engine_->scene_revision());
  const auto scene_frame = ask(a_, simple_frame(FrameType::kDescribe, 1));
  const auto scene = wire::parse_scene(scene_frame->payload());
  EXPECT_EQ(scene.bodies[1].parent, 2u);
  EXPECT_EQ(scene.header.pair_count, 5u) << "a body and the one it follows are no pair";
  EXPECT_EQ(error_of(ask(a_, attach(old_revision))).header.code, static_cast<std::uint16_t>(ErrorCode::kWrongScene));
}

TEST_F(LoopTest, AnAttachmentRefusesThoseAloneWhomItConcerns) {
  start(scattered_scene(6));  // body0 to body5
  wire::AttachRecord record;
  record.child = 1;
  record.parent = 2;
  const std::uint64_t old_revision = engine_->scene_revision();
  ask(a_, simple_frame(FrameType::kAttach, 1, std::as_bytes(std::span(&record, 1))));
  ASSERT_NE(engine_->scene_revision(), old_revision);
  const auto answered = [&](TestQuery query, std::uint64_t revision) {
    query.scene_revision = revision;
    const auto frame = ask(b_, query.frame(1));
    if (frame->type() != FrameType::kReply) {
      EXPECT_EQ(static_cast<ErrorCode>(error_of(frame).header.code), ErrorCode::kWrongScene);
      return false;
    }
    return wire::parse_reply(frame->payload()).scene_revision == revision;
  };
  TestQuery others, both, moved, carrier, all, nearest;
  others.pairs = {{0, 3}, {4, 5}};
  both.pairs = {{1, 2}};  // a named pair stays one, enabled or not
  moved.pairs = {{1, 3}};
  moved.bodies = {1};  // whose poses are now relative to another body
  moved.configurations = {{0, 0, 0, 1, 0, 0, 0}};
  carrier = moved;
  carrier.bodies = {2};
  nearest.pairs = {{0, 3}};
  nearest.header.reduce = static_cast<std::uint8_t>(Reduce::kNearest);
  for (const auto& [query, stays] : {std::pair(others, true), {both, true}, {moved, false}, {carrier, true}, {all, false}, {nearest, true}}) {
    EXPECT_EQ(answered(query, old_revision), stays);
    EXPECT_TRUE(answered(query, engine_->scene_revision()));
    EXPECT_FALSE(answered(query, old_revision + 1)) << "a revision that never was";
  }
  const auto pose_of_body = [&](std::uint32_t body) {
    const wire::PosesHeader head{.count = 1};
    wire::PoseRecord pose;
    pose.body = body;
    pose.pose[3] = 1;
    return ask(b_, wire::FrameBuilder(wire::make_header(FrameType::kSetPoses, 1, 0, old_revision)).add(head).add(pose).take())->type();
  };
  EXPECT_EQ(pose_of_body(1), FrameType::kError) << "X_wb is not X_pb";
  EXPECT_EQ(pose_of_body(2), FrameType::kPosesDone);
  EXPECT_EQ(pose_of_body(3), FrameType::kPosesDone);
  record.child = 4;
  record.parent = 5;
  const auto done = ask(b_, wire::FrameBuilder(wire::make_header(FrameType::kAttach, 1, 0, old_revision)).add(record).take());
  ASSERT_EQ(done->type(), FrameType::kPosesDone);
  EXPECT_EQ(wire::parse_poses_done(done->payload()).scene_revision, old_revision) << "it does not know what the first one did";
}

TEST_F(LoopTest, TellsTheOrderOfPairs) {
  start(small_scene());
  TestQuery query;
  query.pairs = {{kGroupBit | 0u, 0}, {2, 1}};
  const auto frame = ask(a_, query.frame(1, FrameType::kPairs));
  ASSERT_EQ(frame->type(), FrameType::kPairTable);
  const auto table = wire::parse_pair_table(frame->payload());
  EXPECT_EQ(table.header.scene_revision, engine_->scene_revision());
  query.header.fields |= kFieldPair;
  const Reply reply = ask(a_, query);
  ASSERT_EQ(table.pairs.size(), 3u);
  ASSERT_EQ(reply.rows(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(table.pairs[i].a, reply.pair()[i][0]);
    EXPECT_EQ(table.pairs[i].b, reply.pair()[i][1]);
  }
  // With moved bodies: the pairs that have one, though no configuration is sent.
  TestQuery moved;
  moved.bodies = {1};
  moved.configurations = {{0, 0, 0, 1, 0, 0, 0}};
  const auto moved_frame = ask(a_, moved.frame(2, FrameType::kPairs));
  EXPECT_EQ(wire::parse_pair_table(moved_frame->payload()).pairs.size(), 3u);
}

TEST_F(LoopTest, EchoesAndCounts) {
  start(small_scene());
  const std::vector<std::byte> payload{std::byte{1}, std::byte{2}, std::byte{3}};
  const auto echo = ask(a_, simple_frame(FrameType::kPing, 8, payload));
  EXPECT_EQ(echo->type(), FrameType::kPong);
  EXPECT_TRUE(std::equal(payload.begin(), payload.end(), echo->payload().begin(), echo->payload().end()));
  ask(a_, small_query());
  ask(a_, simple_frame(FrameType::kDescribe, 1, payload));  // refused: it has a payload

  const auto frame = ask(a_, simple_frame(FrameType::kGetStats, 9));
  std::map<std::string, std::uint64_t> stats;
  const auto counters = wire::parse_stats(frame->payload());
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

/// A transport that fails in every way that it may.
class FailingTransport final : public Transport {
 public:
  std::string url() const override { return "failing://"; }
  std::vector<int> descriptors() const override { return {}; }
  int poll(Inbox&) override { throw std::runtime_error("the cable was cut"); }
  void tick(Inbox&) override { throw std::runtime_error("still cut"); }
};

TEST_F(LoopTest, AFailingTransportDoesNotStopTheOthers) {
  start(small_scene());
  loop_->add(std::make_unique<FailingTransport>());
  EXPECT_EQ(ask(a_, small_query()).rows(), 1u);
  EXPECT_GE(loop_->counter("errors.transport"), 2u);
}

TEST_F(LoopTest, SleepsWakesAndStops) {
  Loop::Options options;
  options.spin = 0ns;
  options.tick = 10s;  // nothing but the descriptor can wake it in time
  start(small_scene(), options);
  std::thread server([&] { loop_->run(); });
  for (int i = 0; i < 20; ++i) {
    const int before = transport_->sleeps;
    transport_->send(a_, small_query().frame(1));
    transport_->wait_for_reply();
    while (transport_->sleeps == before) std::this_thread::sleep_for(100us);
  }
  loop_->stop();
  server.join();
  EXPECT_EQ(a_.replies.size(), 20u);
  EXPECT_GE(loop_->counter("loop.sleeps"), 20u);
}

/// Counts the loop's ticks.
class TickingTransport final : public Transport {
 public:
  std::string url() const override { return "ticking://"; }
  std::vector<int> descriptors() const override { return {}; }
  int poll(Inbox&) override { return 0; }
  void tick(Inbox&) override { ++ticks; }
  std::atomic<int> ticks{0};
};

TEST_F(LoopTest, OnceWokenItSleepsAgain) {
  Loop::Options options;
  options.spin = 0ns;
  options.tick = 20ms;
  start(small_scene(), options);
  loop_->reload_by([] { return std::make_unique<Engine>(small_scene()); });
  auto ticking = std::make_unique<TickingTransport>();
  const TickingTransport& transport = *ticking;
  loop_->add(std::move(ticking));
  std::thread server([&] { loop_->run(); });
  const auto sleeps_in_five_ticks = [&] {
    const int first = transport.ticks;
    while (transport.ticks < first + 1) std::this_thread::sleep_for(1ms);  // what woke it is done with
    const int begin = transport_->sleeps, tick = transport.ticks;
    while (transport.ticks < tick + 5) std::this_thread::sleep_for(1ms);
    return transport_->sleeps - begin;
  };
  // Nothing ends an idle loop's sleep but the next tick, however long a busy machine makes it wait for that.
  EXPECT_LE(sleeps_in_five_ticks(), 15) << "nothing has woken it";
  EXPECT_TRUE(loop_->read_figures(30s));
  EXPECT_LE(sleeps_in_five_ticks(), 15) << "after a look at its figures";
  loop_->reload();
  const auto reloads = [&] {
    const auto figures = loop_->read_figures(30s);
    for (const auto& [name, value] : figures->counters)
      if (name == "reloads") return value;
    return std::uint64_t{0};
  };
  while (reloads() == 0) std::this_thread::sleep_for(1ms);
  EXPECT_LE(sleeps_in_five_ticks(), 15) << "after a reload";
  loop_->stop();
  server.join();
}

/// Its descriptor stays readable, as a listener's does when no descriptor is left to accept with.
class NaggingTransport final : public Transport {
 public:
  NaggingTransport() : fd_(eventfd(1, EFD_CLOEXEC)) {}
  ~NaggingTransport() override { close(fd_); }
  std::string url() const override { return "nagging://"; }
  std::vector<int> descriptors() const override { return {fd_}; }
  int poll(Inbox&) override {
    ++polls;
    return 0;
  }
  std::atomic<std::uint64_t> polls{0};

 private:
  int fd_;
};

TEST_F(LoopTest, ADescriptorThatStaysReadableDoesNotKeepItBusy) {
  Loop::Options options;
  options.spin = 0ns;
  start(small_scene(), options);
  auto nagging = std::make_unique<NaggingTransport>();
  NaggingTransport& transport = *nagging;
  loop_->add(std::move(nagging));
  std::thread server([&] { loop_->run(); });
  const auto begin = std::chrono::steady_clock::now();
  while (transport.polls < 300)
    std::this_thread::sleep_for(1ms);  // 100 of them without a pause, then one a millisecond
  const auto wall = std::chrono::steady_clock::now() - begin;
  loop_->stop();
  server.join();
  EXPECT_GE(wall, 150ms);
}

}  // namespace
}  // namespace clearance
