// The loop's share of a valid request is bounded, however large the request, measured in the units of work that its
// thread does between two polls of its transports.
#include <gtest/gtest.h>

#include <array>

#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::FrameType;

/// A slice of a small query, and a payload just below the limit of a large one.
constexpr std::uint64_t kMostUnits = 8192;
constexpr int kBodies = 3000;

/// Single points far apart; group 0 has all of them.
engine::Scene crowd() {
  engine::Scene scene;
  std::vector<std::string> names;
  for (int i = 0; i < kBodies; ++i) {
    names.push_back("b" + std::to_string(i));
    scene.add_sphere(names.back(), 0.1, at(i % 50, i / 50, 0));
  }
  scene.add_group("all", names);
  return scene;
}

/// Two bodies of many convex parts that overlap in many places.
engine::Scene heaps(int parts) {
  engine::Scene scene;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int b = 0; b < 2; ++b) {
    Body body;
    body.name = "heap" + std::to_string(b);
    body.pose = Pose{};
    for (int p = 0; p < parts; ++p) {
      const Vec3d centre{3 * unit(random), 3 * unit(random), 3 * unit(random)};
      std::vector<Vec3d> vertices(30);
      for (Vec3d& v : vertices) v = centre + Vec3d{unit(random), unit(random), unit(random)};
      body.parts.push_back(make_convex_part(vertices));
    }
    scene.add_body(std::move(body));
  }
  return scene;
}

/// Twenty balls of one part with a thousand vertices: a query begins on the loop, and does not always finish there.
engine::Scene row_of_balls() {
  engine::Scene scene;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int b = 0; b < 20; ++b) {
    std::vector<Vec3d> vertices(1000);
    for (Vec3d& v : vertices) {
      v = {normal(random), normal(random), normal(random)};
      v = v * (1 / norm(v));
    }
    scene.add_hull("ball" + std::to_string(b), vertices, at(0.05 * b, 0, 0));
  }
  return scene;
}

class BoundedLoop : public LoopTest {
 protected:
  BoundedLoop() { with_worker_ = true; }
  /// Runs the loop until a client has this many replies.
  void serve(const MemoryClient& client, std::size_t replies = 1) {
    while (client.replies.size() < replies) loop_->turn();
  }
  /// Sends a frame and returns its reply, checking the units between two polls.
  std::unique_ptr<MemoryFrame> request_within(std::vector<std::byte> frame) {
    loop_->counter("loop.longest_section_units") = 0;
    transport_->send(a_, std::move(frame));
    serve(a_);
    EXPECT_LE(loop_->counter("loop.longest_section_units"), kMostUnits);
    return take(a_);
  }
  /// Another client's echo, which is served at once.
  std::unique_ptr<MemoryFrame> request_other() {
    transport_->send(b_, simple_frame(FrameType::kPing, 1));
    serve(b_);
    return take(b_);
  }
  /// Compares a reply's bounds with those of the engine, bit by bit.
  void expect_same_bounds(const Result& reply, const QueryView& direct) {
    engine::Engine reference(engine_->scene(), engine::Engine::Options{.threads = 1});
    std::vector<double> lower(reply.rows()), upper(reply.rows());
    ReplyView view;
    view.lower = lower.data();
    view.upper = upper.data();
    view.rows = reply.rows();
    reference.start(direct, view).advance();
    EXPECT_EQ(std::memcmp(reply.lower().data(), lower.data(), 8 * lower.size()), 0);
    EXPECT_EQ(std::memcmp(reply.upper().data(), upper.data(), 8 * upper.size()), 0);
  }
  static TestQuery group_query() {
    TestQuery query;
    query.pairs = {{kGroupBit, kGroupBit}};
    query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
    return query;
  }
};

TEST_F(BoundedLoop, GroupsAreExpandedElsewhere) {
  start(crowd());
  const Result reply = result_of(request_within(group_query().frame(1)));
  EXPECT_EQ(reply.pairs(), std::uint64_t{kBodies} * (kBodies - 1) / 2);
  TestQuery all = group_query();
  all.pairs = {{kEveryBody, kGroupBit}, {kGroupBit, kEveryBody}};
  EXPECT_EQ(result_of(request_within(all.frame(1))).pairs(), std::uint64_t{kBodies} * (kBodies - 1));
}

TEST_F(BoundedLoop, ListsOfPairsAreReadElsewhere) {
  start(crowd());
  TestQuery query;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  // 250 MB of them, the maximum of a message over ZeroMQ.
  constexpr std::uint32_t kPairs = 31'250'000;
  query.pairs.reserve(kPairs);
  for (std::uint32_t i = 0; i < kPairs; ++i)
    query.pairs.push_back({i % kBodies, (i + 1 + i / kBodies % (kBodies - 1)) % kBodies});
  EXPECT_EQ(result_of(request_within(query.frame(1))).pairs(), kPairs);
  query.pairs.back() = {7, 7};
  const auto error = error_of(request_within(query.frame(1)));
  EXPECT_EQ(error.text, "pairs[31249999]: body 7 with itself");
}

TEST_F(BoundedLoop, PairsWithinADistanceAreFoundElsewhere) {
  start(crowd());
  TestQuery query;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kWithin);
  query.header.max_distance = 0.85;  // adjacent ones
  EXPECT_EQ(result_of(request_within(query.frame(1))).rows(), 50u * 59 + 60u * 49);
}

TEST_F(BoundedLoop, BodiesOfManyPartsAreAnsweredElsewhere) {
  start(heaps(60));
  TestQuery query = small_query();
  query.header.signed_distance = 1;
  const Result reply = result_of(request_within(query.frame(1)));
  EXPECT_LT(reply.upper()[0], 0);
}

TEST_F(BoundedLoop, ASmallQueryOfExpensivePairsIsHandedOver) {
  start(row_of_balls());
  TestQuery query;
  query.header.signed_distance = 1;
  const Result reply = result_of(request_within(query.frame(1)));
  ASSERT_EQ(reply.rows(), 190u);
  EXPECT_GT(loop_->counter("queries.handed_over"), 0u);
  QueryView direct;
  direct.signed_distance = true;
  expect_same_bounds(reply, direct);
}

// One motion of all balls, each at its own velocity. A slice of the loop does not complete it for all pairs.
TEST_F(BoundedLoop, AMotionIsBegunHereAndALongOneHandedOver) {
  start(row_of_balls());
  TestQuery query;
  for (std::uint32_t b = 0; b < 20; ++b) query.bodies.push_back(b);
  for (int b = 0; b < 20; ++b) query.configurations.push_back({2.5 * b, 0, 0, 1, 0, 0, 0});
  for (int b = 0; b < 20; ++b) query.configurations.push_back({2.5 * (b * 7 % 20), 3.0 * b, 0, 1, 0, 0, 0});
  query.header.fields = kFieldLower | kFieldUpper;
  query.header.abs_tol = 0.3;
  query.header.rel_tol = 0;
  const std::uint32_t most = 65536;
  wire::append_record(query.records, 10, wire::kRecordRequired, std::as_bytes(std::span(&most, 1)));
  QueryView direct;
  direct.bodies = query.bodies;
  direct.configurations = {reinterpret_cast<const Pose*>(query.configurations.data()), query.configurations.size()};
  direct.configuration_count = 2;
  direct.fields = query.header.fields;
  direct.abs_tol = 0.3;
  direct.rel_tol = 0;
  direct.max_evaluations = most;
  for (const bool is_long : {false, true}) {
    query.pairs = is_long ? std::vector<IdPair>() : std::vector<IdPair>{{0, 1}};
    const std::vector<BodyPair> pairs{{0, 1}};
    direct.pairs = is_long ? std::span<const BodyPair>() : pairs;
    direct.all_pairs = is_long;
    const std::uint64_t before = loop_->counter("queries.handed_over");
    const Result reply = result_of(request_within(query.frame(1)));
    EXPECT_GT(loop_->counter("loop.longest_section_units"), 32u) << "the loop began it";
    EXPECT_EQ(loop_->counter("queries.handed_over") - before, is_long ? 1u : 0u);
    ASSERT_EQ(reply.rows(), is_long ? 190u : 1u);
    expect_same_bounds(reply, direct);
  }
}

TEST_F(BoundedLoop, EchoesAreCopiedElsewhere) {
  start(small_scene());
  const std::vector<std::byte> payload(250'000'000, std::byte{7});
  const auto pong = request_within(simple_frame(FrameType::kPing, 1, payload));
  ASSERT_EQ(pong->type(), FrameType::kPong);
  ASSERT_EQ(pong->body().size(), payload.size());
  EXPECT_EQ(std::memcmp(pong->body().data(), payload.data(), payload.size()), 0);
}

TEST_F(BoundedLoop, LargeScenesAreDescribedElsewhere) {
  start(crowd());
  EXPECT_EQ(request_within(simple_frame(FrameType::kDescribe, 1))->type(), FrameType::kScene);
  EXPECT_EQ(request_within(simple_frame(FrameType::kGetStates, 1))->type(), FrameType::kBodyStates);
  const auto table = request_within(group_query().frame(1, FrameType::kPairs));
  EXPECT_EQ(table->body().size(),
            sizeof(wire::PairsHeader) + std::uint64_t{kBodies} * (kBodies - 1) / 2 * sizeof(BodyPair));
}

/// Poses of a body, repeated `count` times.
std::vector<std::byte> poses_frame(std::uint64_t request, std::uint32_t body, double x, std::uint32_t count) {
  wire::PosesHeader header;
  header.count = count;
  wire::FrameBuilder frame(wire::make_header(FrameType::kSetPoses, request, 0));
  frame.add(header);
  for (std::uint32_t i = 0; i < count; ++i) frame.add(wire::PoseRecord{body, 0, {x, 0, 0, 1, 0, 0, 0}});
  return frame.take();
}

TEST_F(BoundedLoop, ManyPosesAreAppliedElsewhereAndNotOvertaken) {
  start(small_scene());
  loop_->counter("loop.longest_section_units") = 0;
  for (std::uint64_t i = 0; i < 20; ++i) {
    const double x = 1 + static_cast<double>(i);
    transport_->send(a_, poses_frame(3 * i, 1, -x, 20'000));
    transport_->send(a_, poses_frame(3 * i + 1, 1, x, 1));
    TestQuery query = small_query();
    query.header.fields = kDefaultFields | kFieldPoints;
    transport_->send(a_, query.frame(3 * i + 2));
    serve(a_, 3);
    EXPECT_EQ(take(a_)->type(), FrameType::kPosesDone);
    EXPECT_EQ(take(a_)->type(), FrameType::kPosesDone);
    const Result reply = result_of(take(a_));
    EXPECT_NEAR(reply.point_b()[0], x > 1 ? x - 0.1 : 1, 0.1)
        << "the query and the small update came after the large one";
    EXPECT_GT(reply.point_b()[0], 0);
  }
  EXPECT_LE(loop_->counter("loop.longest_section_units"), kMostUnits);
  EXPECT_EQ(loop_->counter("poses.batches"), 40u);
}

TEST_F(BoundedLoop, ThoseThatWaitForPosesAreLookedAtTogether) {
  constexpr int kHeld = 1024;
  Loop::Options options;
  options.max_waiting_per_client = kHeld;
  start(crowd(), options);
  TestQuery query = small_query();
  query.header.deadline_ns = std::chrono::nanoseconds(10s).count();
  query.header.wait_for = kGroupBit;
  const auto move = [&](std::int64_t stamp_ns) {
    const BodyPose pose{1, Pose{{0, 0, 1}}};
    ASSERT_EQ(loop_->on_poses(std::span(&pose, 1), stamp_ns).applied, 1u);
    loop_->counter("loop.longest_section_units") = 0;
    loop_->turn();
    EXPECT_LE(loop_->counter("loop.longest_section_units"), kMostUnits);
  };
  for (int i = 0; i < kHeld; ++i) {
    query.header.min_pose_stamp_ns = 1000 + i;
    transport_->send(a_, query.frame(static_cast<std::uint64_t>(i)));
  }
  while (loop_->held() < kHeld) loop_->turn();
  move(10);
  EXPECT_EQ(loop_->held(), static_cast<std::size_t>(kHeld));
  move(5000);
  serve(a_, kHeld);
  EXPECT_EQ(loop_->held(), 0u);
}

TEST_F(BoundedLoop, TooManyPairsOfPartsAreRejectedBeforeAnyIsEvaluated) {
  Loop::Options options;
  options.max_part_pairs = 3599;
  start(heaps(60), options);
  const auto error = error_of(request_within(small_query().frame(1)));
  EXPECT_EQ(
      error.text,
      "the pairs that this query names have 3600 pairs of convex parts, more than the 3599 that one query may have "
      "(limit max-piece-pairs): split it");
}

TEST_F(BoundedLoop, OthersAreAnsweredWhileTheWorkerWorks) {
  start(heaps(60));
  TestQuery dear = small_query();
  dear.header.signed_distance = 1;
  for (int k = 0; k < 200; ++k) dear.configurations.push_back({1e-3 * k, 0, 0, 1, 0, 0, 0});
  dear.bodies = {1};
  transport_->send(a_, dear.frame(1));
  int answered = 0;
  while (a_.replies.empty()) {
    EXPECT_EQ(request_other()->type(), FrameType::kPong);
    ++answered;
  }
  EXPECT_GT(answered, 10);
}

}  // namespace
}  // namespace clearance
