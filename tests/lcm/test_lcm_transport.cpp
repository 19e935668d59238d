// Queries over the LCM transport, and its own publications.
#include "tests/lcm/lcm_transport_fixture.h"

namespace clearance {
namespace {

// --- queries

/// Compares each column with the engine's own, bit for bit.
void expect_same(const reply_t& reply, const engine::Engine& engine, QueryView query, std::uint32_t fields) {
  query.fields = fields;
  const QuerySize size = engine.size(query);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  std::vector<std::byte> memory(bytes + 64);
  std::byte* base = memory.data() + (64 - reinterpret_cast<std::uintptr_t>(memory.data()) % 64) % 64;
  const ReplyView view = reply_view_over(base, size.rows, size.fields);
  Job job = engine.start(query, view);
  while (!job.advance()) {
  }
  const auto rows = static_cast<std::size_t>(job.info().rows);
  ASSERT_EQ(reply.row_count, static_cast<std::int64_t>(rows));
  EXPECT_EQ(reply.total, static_cast<std::int64_t>(job.info().total));
  EXPECT_EQ(static_cast<std::uint64_t>(reply.snapshot_revision), job.info().snapshot_revision);
  EXPECT_EQ(static_cast<std::uint32_t>(reply.fields), size.fields);
  EXPECT_EQ(static_cast<std::uint64_t>(reply.scene_revision), engine.scene_revision());
  const auto scalars = [&](const auto& column, const auto* own, const char* name) {
    using T = std::remove_cvref_t<decltype(*own)>;
    ASSERT_EQ(column.size(), own == nullptr ? 0 : rows) << name;
    for (std::size_t i = 0; i < column.size(); ++i) {
      const T value = static_cast<T>(column[i]);
      EXPECT_EQ(std::memcmp(&value, own + i, sizeof value), 0) << name << " " << i;
    }
  };
  const auto vectors = [&](const auto& column, const auto* own, std::size_t width, const char* name) {
    using T = std::remove_cvref_t<decltype(*own)>;
    ASSERT_EQ(column.size(), own == nullptr ? 0 : rows) << name;
    for (std::size_t i = 0; i < column.size(); ++i) {
      ASSERT_EQ(column[i].size(), width) << name;
      for (std::size_t k = 0; k < width; ++k) {
        const T value = static_cast<T>(column[i][k]);
        EXPECT_EQ(std::memcmp(&value, own + i * width + k, sizeof value), 0) << name << " " << i;
      }
    }
  };
  scalars(reply.distance, view.distance, "distance");
  scalars(reply.lower, view.lower, "lower");
  scalars(reply.upper, view.upper, "upper");
  scalars(reply.status, view.status, "status");
  scalars(reply.flags, view.flags, "flags");
  vectors(reply.point_a, view.point_a, 3, "point_a");
  vectors(reply.point_b, view.point_b, 3, "point_b");
  vectors(reply.normal, view.normal, 3, "normal");
  vectors(reply.pieces, view.parts, 2, "pieces");
  vectors(reply.gradient, view.gradient, 12, "gradient");
  vectors(reply.pair, reinterpret_cast<const std::uint32_t*>(view.pair), 2, "pair");
  scalars(reply.configuration, view.configuration, "configuration");
  vectors(reply.points32, view.points32, 6, "points32");
  vectors(reply.bounds, view.bounds, 2, "bounds");
}

TEST_F(LcmTransportTest, AnEmptyQueryRequestsAllPairs) {
  start();
  set_poses(1, 0.7);
  const auto reply = evaluate(query_message());
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->row_count, 21);  // seven bodies
  EXPECT_EQ(reply->backend, engine_->backend());
  EXPECT_EQ(reply->client_id, 4242);
  EXPECT_EQ(reply->snapshot_stamp_ns, 1000);
  EXPECT_GT(reply->server_ns, 0);
  expect_same(*reply, *engine_, {}, kDefaultFields | kFieldPair);
}

TEST_F(LcmTransportTest, EveryColumn) {
  start();
  set_poses(1, 0.7);
  query_t query = query_message();
  const std::uint32_t fields = kDefaultFields | kFieldFlags | kFieldPoints | kFieldNormal | kFieldPieces |
                               kFieldGradient | kFieldPair | kFieldConfiguration;
  query.fields = static_cast<std::int32_t>(fields);
  const auto reply = evaluate(query);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->error_code, 0) << reply->error_text;
  EXPECT_EQ(reply->gradient.size(), 21u);
  expect_same(*reply, *engine_, {}, fields);
}

TEST_F(LcmTransportTest, Float32Columns) {
  start();
  set_poses(1, 0.7);
  query_t query = query_message();
  query.fields = static_cast<std::int32_t>(kFieldBounds | kFieldPoints32);
  const auto reply = evaluate(query);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->error_code, 0) << reply->error_text;
  EXPECT_EQ(reply->points32.size(), 21u);
  expect_same(*reply, *engine_, {}, kFieldBounds | kFieldPoints32);
}

TEST_F(LcmTransportTest, Reductions) {
  start();
  set_poses(1, 0.7);
  for (const Reduce reduce : {Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
    query_t query = query_message();
    query.reduce = static_cast<std::int8_t>(reduce);
    query.max_distance = 1.0;
    const auto reply = evaluate(query);
    ASSERT_TRUE(reply);
    ASSERT_EQ(reply->error_code, 0) << reply->error_text;
    EXPECT_GT(reply->row_count, 0);
    QueryView view;
    view.max_distance = 1.0;
    view.reduce = reduce;
    expect_same(*reply, *engine_, view, kDefaultFields | kFieldPair);
  }
}

TEST_F(LcmTransportTest, ConfigurationsInManyParts) {
  start();
  set_poses(1, 0.7);
  // 100 configurations of two bodies, all fields: the answer takes several messages.
  constexpr int kConfigurations = 100;
  query_t query = query_message();
  query.body_count = 2;
  query.bodies = {2, 5};
  std::vector<Pose> poses;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> anywhere(-3, 3);
  for (int k = 0; k < kConfigurations; ++k) {
    query.configurations.emplace_back();
    for (int m = 0; m < 2; ++m) {
      const Pose X{{anywhere(random), anywhere(random), anywhere(random)}, 1, 0.1, 0.2, 0.3};
      poses.push_back(X);
      query.configurations.back().push_back(
          {X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz});
    }
  }
  query.configuration_count = kConfigurations;
  const std::uint32_t fields =
      kDefaultFields | kFieldPoints | kFieldNormal | kFieldGradient | kFieldPair | kFieldConfiguration;
  query.fields = static_cast<std::int32_t>(fields);
  const auto reply = evaluate(query);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->error_code, 0) << reply->error_text;
  EXPECT_EQ(reply->configurations, kConfigurations);
  EXPECT_GE(reply->parts, 5);
  const std::vector<std::uint32_t> bodies{2, 5};
  QueryView view;
  view.configuration_count = kConfigurations;
  view.bodies = bodies;
  view.configurations = poses;
  expect_same(*reply, *engine_, view, fields);
}

TEST_F(LcmTransportTest, RejectionsSayWhy) {
  start();
  set_poses(1, 0.7);
  const auto reject = [&](const query_t& query, int code, const std::string& text) {
    const auto reply = evaluate(query);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->error_code, code) << reply->error_text;
    EXPECT_NE(reply->error_text.find(text), std::string::npos) << reply->error_text;
    EXPECT_EQ(reply->row_count, 0);
    EXPECT_TRUE(reply->distance.empty());
  };
  query_t query = query_message();
  query.scene_revision = 77;
  reject(query, 2, "77");
  query = query_message();
  query.reduce = 9;
  reject(query, 1, "reduce");
  query = query_message();
  query.precision = 9;
  reject(query, 1, "precision");
  query = query_message();
  query.max_distance = std::nan("");
  reject(query, 1, "max_distance");
  query = query_message();
  query.rel_tol = std::nan("");
  reject(query, 1, "rel_tol");
  query = query_message();
  query.fields = 1 << kFieldCount;
  reject(query, 1, "fields");
  query.fields = kFieldPairLower;
  reject(query, 1, "reply_t has no column pair_lower");
  query.fields = kFieldGradientJoints;
  reject(query, 1, "reply_t has no column gradient_joints");
  query.fields = kFieldVerdict;
  reject(query, 1, "reply_t has no column verdict");
  query = query_message();
  query.max_results = -1;
  query.reduce = query_t::REDUCE_WITHIN;
  query.body_count = 1;
  query.bodies = {999};
  query.configuration_count = 1;
  query.configurations = {{{0, 0, 0, 1, 0, 0, 0}}};
  reject(query, 1, "999");
  // An out-of-range body of a pair gives a status of its row, not an error.
  query = query_message();
  query.pair_count = 1;
  query.pairs = {{0, 999}};
  const auto reply = evaluate(query);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->status.size(), 1u);
  EXPECT_EQ(reply->status[0], reply_t::STATUS_UNKNOWN_BODY);
}

// --- queries that wait for poses

TEST_F(LcmTransportTest, AQueryWaitsForPosesOfItsStamp) {
  start();
  set_poses(1, 0.1);
  query_t waiting = query_message();
  waiting.min_pose_stamp_ns = 2000;
  waiting.deadline_ns = 10'000'000'000;
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_QUERY", waiting));
  ASSERT_TRUE(until_counter("queries.held_back", 1));
  expect_good_answer();  // to another query, meanwhile
  EXPECT_EQ(answers_.size(), 1u);
  answers_.clear();
  set_poses(2, 0.2);
  ASSERT_TRUE(until([&] { return answers_.size() == 1; }));
  const reply_t& reply = answers_.begin()->second.whole;
  EXPECT_EQ(reply.error_code, 0) << reply.error_text;
  EXPECT_EQ(reply.client_id, waiting.client_id);
  EXPECT_EQ(reply.request_id, waiting.request_id);
  EXPECT_EQ(reply.snapshot_stamp_ns, 2000);
  expect_same(reply, *engine_, {}, kDefaultFields | kFieldPair);
}

TEST_F(LcmTransportTest, PosesThatDoNotComeAreReported) {
  start();
  set_poses(1, 0.1);
  const auto evaluate_for = [&](query_t query) {
    query.request_id = query_message().request_id;
    answers_.clear();
    EXPECT_TRUE(bus_->publish_message("CLEARANCE_QUERY", query));
    EXPECT_TRUE(until([&] { return answers_.size() == 1; }));
    return answers_.empty() ? reply_t{} : answers_.begin()->second.whole;
  };
  query_t query = query_message();
  query.min_pose_stamp_ns = 1001;
  query.deadline_ns = 2'000'000;
  reply_t reply = evaluate_for(query);
  EXPECT_EQ(reply.error_code, reply_t::ERROR_POSES_LATE);
  EXPECT_EQ(reply.error_text, "no poses with stamp 1001 or newer came within 2.000000 ms");
  query.deadline_ns = -1;
  EXPECT_EQ(evaluate_for(query).error_text, "query: deadline_ns must be 0 to 3600000000000, got -1");

  query = query_message();
  query.min_pose_stamp_ns = 1000;
  query.wait_for_one = true;  // the table has no stamp of its own
  EXPECT_EQ(evaluate_for(query).error_code, reply_t::ERROR_POSES_LATE);
  query.wait_for = 1;
  query.max_pose_age_ns = 1;
  reply = evaluate_for(query);
  EXPECT_EQ(reply.error_code, 0) << reply.error_text;
  EXPECT_EQ(std::count(reply.status.begin(), reply.status.end(), reply_t::STATUS_STALE_POSE), reply.row_count);
  EXPECT_EQ(reply.row_count, 21);
}

// --- publications of the daemon

TEST_F(LcmTransportTest, LateJoinersLearnTheScene) {
  start();
  ASSERT_TRUE(until([&] { return !scenes_.empty(); }));
  // A subscriber that joins later.
  LcmBus late(address_);
  std::optional<scene_t> heard;
  late.subscribe("CLEARANCE_SCENE", 8, [&](std::span<const std::byte> packet) {
    heard.emplace().decode(packet.data(), 0, static_cast<int>(packet.size()));
  });
  ASSERT_TRUE(until([&] {
    while (late.handle()) {
    }
    return heard.has_value();
  }));
  EXPECT_EQ(static_cast<std::uint64_t>(heard->revision), engine_->scene_revision());
  EXPECT_EQ(heard->parts, 1);
  EXPECT_EQ(heard->body_total, 7);
  EXPECT_EQ(heard->pair_total, 21);
  EXPECT_EQ(heard->ids, (std::vector<std::int32_t>{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(heard->names, (std::vector<std::string>{"table", "ball0", "ball1", "ball2", "ball3", "ball4", "ball5"}));
  EXPECT_EQ(heard->is_static, (std::vector<std::int8_t>{1, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(heard->parents, std::vector<std::int32_t>(7, scene_t::NONE));
  EXPECT_EQ(heard->group_names, (std::vector<std::string>{"arm"}));
  EXPECT_EQ(heard->members, (std::vector<std::vector<std::int32_t>>{{0, 1}, {0, 2}, {0, 3}}));
  EXPECT_NEAR(heard->extent[2], 0.11, 1e-12);
}

TEST_F(LcmTransportTest, AChangedSceneIsPublishedAtOnce) {
  start();
  set_poses(1, 0.7);
  ASSERT_TRUE(until([&] { return !scenes_.empty(); }));
  engine_->attach(2, 1);
  const auto revision = static_cast<std::int64_t>(engine_->scene_revision());
  ASSERT_TRUE(until([&] { return scenes_.back().revision == revision; }));
  EXPECT_EQ(scenes_.back().parents[2], 1);
}

TEST_F(LcmTransportTest, StatesSayWhereTheBodiesAre) {
  start();
  ASSERT_TRUE(until([&] { return !states_.empty(); }));
  EXPECT_EQ(states_.back().status[1], reply_t::STATUS_NO_POSE);
  set_poses(1, 0.7);
  ASSERT_TRUE(until([&] { return static_cast<std::uint64_t>(states_.back().revision) == engine_->pose_revision(); }));
  const states_t& states = states_.back();
  ASSERT_EQ(states.count, 7);
  EXPECT_EQ(states.status, std::vector<std::uint8_t>(7, reply_t::STATUS_OK));
  EXPECT_EQ(states.poses[0], (std::vector<double>{0, 0, -1, 1, 0, 0, 0}));
  for (int i = 0; i < kMoving; ++i) {
    EXPECT_EQ(std::vector<double>(states.poses[1 + i].begin(), states.poses[1 + i].begin() + 3), position_of(i, 0.7));
    EXPECT_EQ(states.stamp_ns[1 + i], 1000);
    EXPECT_LE(states.receipt_ns[1 + i], states.now_ns);
    EXPECT_GT(states.receipt_ns[1 + i], 0);
  }
}

TEST_F(LcmTransportTest, StatusHasTheCounters) {
  start();
  set_poses(1, 0.1);
  set_poses(4, 0.2);
  ASSERT_TRUE(until([&] {
    if (statuses_.empty()) return false;
    const status_t& status = statuses_.back();
    const auto found = std::find(status.names.begin(), status.names.end(), "lcm.gaps");
    return found != status.names.end() && status.values[found - status.names.begin()] == 2;
  }));
  EXPECT_EQ(static_cast<std::uint64_t>(statuses_.back().scene_revision), engine_->scene_revision());
  EXPECT_EQ(statuses_.back().backend, engine_->backend());
  EXPECT_GT(statuses_.back().uptime_ns, 0);
  EXPECT_EQ(counter("lcm.other_daemons"), 0u);
}

TEST_F(LcmTransportTest, AnotherDaemonIsNoticed) {
  start();
  engine::Engine engine(make_scene(), engine::Engine::Options{.threads = 1});
  Loop other(engine);
  other.add(make_lcm_transport(url()));
  ASSERT_TRUE(until([&] {
    other.turn();
    return counter("lcm.other_daemons") > 0;
  }));
}

TEST_F(LcmTransportTest, ListenersGetDistances) {
  start("&distances_hz=20");
  set_poses(1, 0.7);
  const auto at_newest = [&] {
    return !distances_.empty() &&
           static_cast<std::uint64_t>(distances_.back().snapshot_revision) == engine_->pose_revision();
  };
  ASSERT_TRUE(until(at_newest));
  const distances_t message = distances_.back();
  ASSERT_EQ(message.count, 7);
  for (int i = 0; i < 7; ++i) {
    EXPECT_TRUE(message.pairs[i][0] == i || message.pairs[i][1] == i);
    EXPECT_EQ(message.status[i], reply_t::STATUS_OK);
    EXPECT_GT(message.lower[i], 0);
    EXPECT_LE(message.lower[i], message.distance[i]);
    EXPECT_LE(message.distance[i], message.upper[i]);
    double squared = 0;
    for (int k = 0; k < 3; ++k) squared += std::pow(message.point_a[i][k] - message.point_b[i][k], 2);
    EXPECT_NEAR(std::sqrt(squared), message.upper[i], 1e-9);
  }
  // A burst beyond the rate: some are dropped, but never the newest.
  distances_.clear();
  for (int k = 2; k <= 101; ++k) publish(update(k, 0.01 * k));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 101));
  ASSERT_TRUE(until(at_newest));
  EXPECT_LT(distances_.size(), 50u);
  for (std::size_t i = 1; i < distances_.size(); ++i) EXPECT_EQ(distances_[i].sequence, distances_[i - 1].sequence + 1);
}

TEST_F(LcmTransportTest, NoDistancesUnlessRequested) {
  start();
  set_poses(1, 0.7);
  set_poses(2, 0.8);
  const std::size_t before = statuses_.size();
  ASSERT_TRUE(until([&] { return statuses_.size() >= before + 2; }));
  EXPECT_TRUE(distances_.empty());
}

}  // namespace
}  // namespace clearance
