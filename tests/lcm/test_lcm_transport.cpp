// The daemon's loop on an LCM network, and a planner that knows nothing of ours but the message types.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <random>
#include <set>

#include "clearance_lcm/distances_t.hpp"
#include "clearance_lcm/frame_t.hpp"
#include "clearance_lcm/named_pose_update_t.hpp"
#include "clearance_lcm/pose_update_t.hpp"
#include "clearance_lcm/query_t.hpp"
#include "clearance_lcm/reply_t.hpp"
#include "clearance_lcm/scene_t.hpp"
#include "clearance_lcm/states_t.hpp"
#include "clearance_lcm/status_t.hpp"
#include "engine/engine.h"
#include "lcm_fixture.h"
#include "server/loop.h"
#include "server/transport.h"

namespace clearance {
namespace {

using clearance_lcm::distances_t;
using clearance_lcm::named_pose_update_t;
using clearance_lcm::pose_update_t;
using clearance_lcm::query_t;
using clearance_lcm::reply_t;
using clearance_lcm::scene_t;
using clearance_lcm::states_t;
using clearance_lcm::status_t;

constexpr int kMoving = 6;

/// A static table and six balls; "arm" is the first three.
Scene make_scene() {
  Scene scene;
  Scene::BodyOptions table;
  table.is_static = true;
  table.pose = Pose{{0, 0, -1}, 1, 0, 0, 0};
  scene.add_box("table", {4, 4, 0.5}, table);
  for (int i = 0; i < kMoving; ++i) scene.add_sphere("ball" + std::to_string(i), 0.1 + 0.01 * i, {});
  const std::vector<std::string> arm{"ball0", "ball1", "ball2"};
  scene.add_group("arm", arm);
  return scene;
}

/// Where ball i is in step k: far enough from the others that nothing touches.
std::vector<double> pose_of(int ball, double step) {
  return {1.0 * ball + 0.25 * std::sin(step + ball), 0.5 * std::cos(2 * step), 0.1 * ball, 1, 0.1 * ball, 0.2, 0.3};
}

/// An answer of which all parts are there, columns joined.
struct Answer {
  reply_t whole;
  std::set<int> parts;
};

class LcmTransportTest : public LcmTest {
 protected:
  void start(const std::string& options = "") {
    engine_.emplace(make_scene(), Engine::Options{.threads = 1});
    loop_.emplace(*engine_);
    loop_->add(make_lcm_transport(url(options)));
    bus_.emplace(address_);
    bus_->subscribe("CLEARANCE_REPLY", 4096, [this](auto packet) { on_reply(packet); });
    bus_->subscribe("CLEARANCE_SCENE", 64, [this](auto packet) { keep(scenes_, packet); });
    bus_->subscribe("CLEARANCE_STATUS", 64, [this](auto packet) { keep(statuses_, packet); });
    bus_->subscribe("CLEARANCE_STATES", 64, [this](auto packet) { keep(states_, packet); });
    bus_->subscribe("CLEARANCE_DISTANCES", 64, [this](auto packet) { keep(distances_, packet); });
  }

  /// Turns the daemon's loop and takes the planner's messages until `done`; false after ten seconds.
  bool until(const std::function<bool()>& done) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!done()) {
      const bool worked = loop_->turn();
      bool heard = false;
      while (bus_->handle()) heard = true;
      if (!worked && !heard) bus_->wait(std::chrono::steady_clock::now() + std::chrono::milliseconds(1));
      if (std::chrono::steady_clock::now() > deadline) return false;
    }
    return true;
  }
  std::uint64_t counter(const std::string& name) { return loop_->counter(name); }
  bool until_counter(const std::string& name, std::uint64_t value) {
    return until([&] { return counter(name) >= value; });
  }

  pose_update_t update(std::int64_t sequence, double step, std::int64_t publisher = 1) {
    pose_update_t message{};
    message.publisher_id = publisher;
    message.sequence = sequence;
    message.stamp_ns = 1000 * sequence;
    message.count = kMoving;
    for (int i = 0; i < kMoving; ++i) {
      message.bodies.push_back(1 + i);
      message.poses.push_back(pose_of(i, step));
    }
    return message;
  }
  void publish(const pose_update_t& message) { ASSERT_TRUE(bus_->publish_message("CLEARANCE_POSES", message)); }
  /// Publishes poses and waits until the daemon has them.
  void set_poses(std::int64_t sequence, double step) {
    const std::uint64_t before = counter("lcm.pose_messages");
    publish(update(sequence, step));
    ASSERT_TRUE(until_counter("lcm.pose_messages", before + 1));
  }
  std::vector<double> position(std::uint32_t body) {
    const Pose X = engine_->body_state(body).X_wb;
    return {X.translation.x, X.translation.y, X.translation.z};
  }
  static std::vector<double> position_of(int ball, double step) {
    auto pose = pose_of(ball, step);
    pose.resize(3);
    return pose;
  }

  query_t question() {
    query_t query{};
    query.client_id = 4242;
    query.request_id = ++last_request_;
    return query;
  }
  /// The whole answer; asks again if a part was lost on the way.
  std::optional<reply_t> ask(query_t query) {
    for (int attempt = 0; attempt < 10; ++attempt) {
      query.request_id = ++last_request_;
      answers_.clear();
      if (!bus_->publish_message("CLEARANCE_QUERY", query)) return std::nullopt;
      const auto whole = [&]() -> const Answer* {
        for (const auto& [sequence, answer] : answers_) {
          if (answer.whole.request_id == query.request_id &&
              answer.parts.size() == static_cast<std::size_t>(answer.whole.parts)) {
            return &answer;
          }
        }
        return nullptr;
      };
      const auto patience = std::chrono::steady_clock::now() + std::chrono::seconds(3);
      until([&] { return whole() != nullptr || std::chrono::steady_clock::now() > patience; });
      if (const Answer* answer = whole()) return answer->whole;
    }
    return std::nullopt;
  }
  void expect_good_answer() {
    query_t query = question();
    query.pair_count = 1;
    query.pairs = {{1, 2}};
    const auto reply = ask(query);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->error_code, 0) << reply->error_text;
    EXPECT_EQ(reply->distance.size(), 1u);
  }

  std::optional<Engine> engine_;
  std::optional<Loop> loop_;
  std::optional<LcmBus> bus_;
  std::map<std::int64_t, Answer> answers_;
  std::vector<scene_t> scenes_;
  std::vector<states_t> states_;
  std::vector<status_t> statuses_;
  std::vector<distances_t> distances_;
  std::int64_t last_request_ = 0;

 private:
  template <class Message>
  void keep(std::vector<Message>& list, std::span<const std::byte> packet) {
    EXPECT_LE(packet.size(), kLcmMessageBytes);
    Message message;
    ASSERT_EQ(message.decode(packet.data(), 0, static_cast<int>(packet.size())), static_cast<int>(packet.size()));
    list.push_back(std::move(message));
  }

  void on_reply(std::span<const std::byte> packet) {
    EXPECT_LE(packet.size(), kLcmMessageBytes);
    reply_t part;
    ASSERT_EQ(part.decode(packet.data(), 0, static_cast<int>(packet.size())), static_cast<int>(packet.size()));
    Answer& answer = answers_[part.sequence];
    if (answer.parts.empty()) {
      answer.whole = part;
      answer.parts.insert(part.part);
      // Parts come in order on one host, so columns can simply be joined.
      ASSERT_EQ(part.first_row, 0);
      return;
    }
    ASSERT_EQ(part.part, static_cast<int>(answer.parts.size()));
    answer.parts.insert(part.part);
    const auto join = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    reply_t& whole = answer.whole;
    join(whole.distance, part.distance);
    join(whole.lower, part.lower);
    join(whole.upper, part.upper);
    join(whole.status, part.status);
    join(whole.flags, part.flags);
    join(whole.point_a, part.point_a);
    join(whole.point_b, part.point_b);
    join(whole.normal, part.normal);
    join(whole.pieces, part.pieces);
    join(whole.gradient, part.gradient);
    join(whole.pair, part.pair);
    join(whole.configuration, part.configuration);
    join(whole.compact, part.compact);
  }
};

// --- poses

TEST_F(LcmTransportTest, PosesApplyAsAWhole) {
  start();
  for (int k = 1; k <= 20; ++k) {
    const std::uint64_t revision = engine_->pose_revision();
    set_poses(k, 0.1 * k);
    EXPECT_EQ(engine_->pose_revision(), revision + 1);
    for (int i = 0; i < kMoving; ++i) {
      EXPECT_EQ(position(1 + i), position_of(i, 0.1 * k));
      EXPECT_EQ(engine_->body_state(1 + i).stamp_ns, 1000 * k);
    }
  }
  EXPECT_EQ(counter("lcm.gaps"), 0u);
  EXPECT_EQ(counter("lcm.publishers"), 1u);
}

TEST_F(LcmTransportTest, QueriesSeeNoHalfOfAnUpdate) {
  start();
  // All balls move together, so that the distances between them are those of the one step or of the next, never a mix.
  std::map<std::vector<double>, int> seen;
  const auto together = [&](int k) {
    pose_update_t message = update(k, 0);
    for (int i = 0; i < kMoving; ++i) message.poses[i] = {0.5 * i * (k % 2 == 0 ? 1 : 2), 1.0 * k, 0, 1, 0, 0, 0};
    return message;
  };
  publish(together(1));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  for (int k = 2; k <= 60; ++k) {
    query_t query = question();
    query.pair_count = 1;
    query.pairs = {{query_t::GROUP, query_t::EVERY_BODY}};
    query.max_distance = 100;
    publish(together(k));
    ASSERT_TRUE(bus_->publish_message("CLEARANCE_QUERY", query));
    publish(together(++k));
    ASSERT_TRUE(until([&] { return answers_.size() == 1; }));
    const reply_t reply = answers_.begin()->second.whole;
    answers_.clear();
    std::vector<double> between;
    for (std::size_t i = 0; i < reply.distance.size(); ++i) {
      if (reply.pair[i][0] != 0) between.push_back(reply.distance[i] + 0.2 + 0.01 * (reply.pair[i][0] + reply.pair[i][1] - 2));
    }
    ASSERT_EQ(between.size(), 12u);  // of 15 pairs of balls those with one of the arm
    for (auto& d : between) d = std::round(d * 1e6) / 1e6;
    ++seen[between];
  }
  EXPECT_LE(seen.size(), 2u);
  EXPECT_TRUE(until_counter("lcm.pose_messages", 60));
}

TEST_F(LcmTransportTest, OrderIsKeptForEachPublisher) {
  start();
  set_poses(10, 1.0);
  set_poses(11, 1.1);
  EXPECT_EQ(counter("lcm.gaps"), 0u);
  set_poses(15, 1.5);  // 12, 13 and 14 are missing
  EXPECT_EQ(counter("lcm.gaps"), 3u);
  const std::uint64_t revision = engine_->pose_revision();
  publish(update(13, 1.3));  // late
  ASSERT_TRUE(until_counter("lcm.reordered", 1));
  publish(update(15, 9.9));  // the same again
  ASSERT_TRUE(until_counter("lcm.repeated", 1));
  EXPECT_EQ(engine_->pose_revision(), revision);
  EXPECT_EQ(position(1), position_of(0, 1.5));
  // Another publisher counts for itself, and so does the other channel.
  publish(update(1, 2.0, 2));
  ASSERT_TRUE(until([&] { return engine_->pose_revision() == revision + 1; }));
  named_pose_update_t named{};
  named.publisher_id = 1;
  named.sequence = 1;
  named.count = 1;
  named.names = {"ball3"};
  named.poses = {{7, 8, 9, 1, 0, 0, 0}};
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_POSES_NAMED", named));
  ASSERT_TRUE(until([&] { return engine_->pose_revision() == revision + 2; }));
  EXPECT_EQ(position(4), (std::vector<double>{7, 8, 9}));
  EXPECT_EQ(counter("lcm.gaps"), 3u);
  EXPECT_EQ(counter("lcm.reordered"), 1u);
  EXPECT_EQ(counter("lcm.publishers"), 3u);
  // One that goes far back has begun to count anew.
  set_poses(5000, 3.0);
  set_poses(1, 3.1);
  EXPECT_EQ(counter("lcm.restarts"), 1u);
  EXPECT_EQ(position(1), position_of(0, 3.1));
}

TEST_F(LcmTransportTest, NamesThatAreUnknownAreLeftOut) {
  start();
  named_pose_update_t named{};
  named.publisher_id = 3;
  named.sequence = 1;
  named.count = 3;
  named.names = {"ball0", "nobody", "ball1"};
  named.poses = {{1, 0, 0, 1, 0, 0, 0}, {2, 0, 0, 1, 0, 0, 0}, {3, 0, 0, 1, 0, 0, 0}};
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_POSES_NAMED", named));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(counter("lcm.unknown_bodies"), 1u);
  EXPECT_EQ(position(1), (std::vector<double>{1, 0, 0}));
  EXPECT_EQ(position(2), (std::vector<double>{3, 0, 0}));
}

TEST_F(LcmTransportTest, IdsOfAnotherSceneAreRefused) {
  start();
  pose_update_t other = update(1, 1.0);
  other.scene_revision = 12345;
  publish(other);
  ASSERT_TRUE(until_counter("lcm.wrong_scene", 1));
  EXPECT_EQ(engine_->body_state(1).status, Status::kNoPose);
  pose_update_t own = update(1, 1.0);
  own.scene_revision = static_cast<std::int64_t>(engine_->scene_revision());
  publish(own);
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(position(1), position_of(0, 1.0));
  pose_update_t unknown = update(2, 2.0);
  unknown.bodies[0] = 99;
  publish(unknown);
  ASSERT_TRUE(until_counter("lcm.unknown_bodies", 1));
  EXPECT_EQ(position(2), position_of(1, 2.0));
  pose_update_t nobody = update(3, 3.0);
  nobody.publisher_id = 0;
  publish(nobody);
  ASSERT_TRUE(until_counter("lcm.bad_messages", 1));
  EXPECT_EQ(position(2), position_of(1, 2.0));
}

TEST_F(LcmTransportTest, TwoPublishersOfOneBody) {
  start();
  set_poses(1, 1.0);
  publish(update(1, 1.0, 2));  // takes over: a restarted publisher does that too
  ASSERT_TRUE(until_counter("lcm.pose_messages", 2));
  publish(update(2, 1.0, 2));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 3));
  EXPECT_EQ(counter("lcm.contested"), 0u);
  set_poses(2, 1.0);  // the first one is back
  EXPECT_EQ(counter("lcm.contested"), static_cast<std::uint64_t>(kMoving));
}

// --- queries

/// Compares each column with what the engine says itself, bit for bit.
void expect_same(const reply_t& reply, const Engine& engine, QueryView query, std::uint32_t fields) {
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
  vectors(reply.pieces, view.pieces, 2, "pieces");
  vectors(reply.gradient, view.gradient, 12, "gradient");
  vectors(reply.pair, reinterpret_cast<const std::uint32_t*>(view.pair), 2, "pair");
  scalars(reply.configuration, view.configuration, "configuration");
  vectors(reply.compact, reinterpret_cast<const float*>(view.compact), 8, "compact");
}

TEST_F(LcmTransportTest, AnEmptyQueryAsksForAllPairs) {
  start();
  set_poses(1, 0.7);
  const auto reply = ask(question());
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
  query_t query = question();
  const std::uint32_t fields = kDefaultFields | kFieldFlags | kFieldPoints | kFieldNormal | kFieldPieces | kFieldGradient |
                               kFieldPair | kFieldConfiguration;
  query.fields = static_cast<std::int32_t>(fields);
  const auto reply = ask(query);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->error_code, 0) << reply->error_text;
  EXPECT_EQ(reply->gradient.size(), 21u);
  expect_same(*reply, *engine_, {}, fields);
}

TEST_F(LcmTransportTest, Compact) {
  start();
  set_poses(1, 0.7);
  query_t query = question();
  query.format = static_cast<std::int8_t>(Format::kCompact);
  const auto reply = ask(query);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->error_code, 0) << reply->error_text;
  EXPECT_EQ(reply->compact.size(), 21u);
  QueryView view;
  view.format = Format::kCompact;
  expect_same(*reply, *engine_, view, kDefaultFields | kFieldPair);
}

TEST_F(LcmTransportTest, Reductions) {
  start();
  set_poses(1, 0.7);
  for (const Reduce reduce : {Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
    query_t query = question();
    query.reduce = static_cast<std::int8_t>(reduce);
    query.max_distance = 1.0;
    const auto reply = ask(query);
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
  query_t query = question();
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
      query.configurations.back().push_back({X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz});
    }
  }
  query.configuration_count = kConfigurations;
  const std::uint32_t fields = kDefaultFields | kFieldPoints | kFieldNormal | kFieldGradient | kFieldPair | kFieldConfiguration;
  query.fields = static_cast<std::int32_t>(fields);
  const auto reply = ask(query);
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

TEST_F(LcmTransportTest, RefusalsSayWhy) {
  start();
  set_poses(1, 0.7);
  const auto refuse = [&](const query_t& query, int code, const std::string& text) {
    const auto reply = ask(query);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->error_code, code) << reply->error_text;
    EXPECT_NE(reply->error_text.find(text), std::string::npos) << reply->error_text;
    EXPECT_EQ(reply->row_count, 0);
    EXPECT_TRUE(reply->distance.empty());
  };
  query_t query = question();
  query.scene_revision = 77;
  refuse(query, 2, "77");
  query = question();
  query.reduce = 9;
  refuse(query, 1, "reduce");
  query = question();
  query.precision = 9;
  refuse(query, 1, "precision");
  query = question();
  query.max_distance = std::nan("");
  refuse(query, 1, "max_distance");
  query = question();
  query.rel_tol = std::nan("");
  refuse(query, 1, "rel_tol");
  query = question();
  query.fields = 1 << 20;
  refuse(query, 1, "fields");
  query = question();
  query.max_results = -1;
  query.reduce = query_t::REDUCE_WITHIN;
  query.body_count = 1;
  query.bodies = {999};
  query.configuration_count = 1;
  query.configurations = {{{0, 0, 0, 1, 0, 0, 0}}};
  refuse(query, 1, "999");
  // Out of range in a pair is a status of its row, not an error.
  query = question();
  query.pair_count = 1;
  query.pairs = {{0, 999}};
  const auto reply = ask(query);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->status.size(), 1u);
  EXPECT_EQ(reply->status[0], reply_t::STATUS_UNKNOWN_BODY);
}

// --- what the daemon publishes by itself

TEST_F(LcmTransportTest, LateJoinersLearnTheScene) {
  start();
  ASSERT_TRUE(until([&] { return !scenes_.empty(); }));
  // Somebody who comes later.
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
  EXPECT_EQ(heard->names,
            (std::vector<std::string>{"table", "ball0", "ball1", "ball2", "ball3", "ball4", "ball5"}));
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
  Engine engine(make_scene(), Engine::Options{.threads = 1});
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
  // A burst faster than the rate: not each of it, but always the newest.
  distances_.clear();
  for (int k = 2; k <= 101; ++k) publish(update(k, 0.01 * k));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 101));
  ASSERT_TRUE(until(at_newest));
  EXPECT_LT(distances_.size(), 50u);
  for (std::size_t i = 1; i < distances_.size(); ++i) EXPECT_EQ(distances_[i].sequence, distances_[i - 1].sequence + 1);
}

TEST_F(LcmTransportTest, NoDistancesUnlessAskedFor) {
  start();
  set_poses(1, 0.7);
  set_poses(2, 0.8);
  const std::size_t before = statuses_.size();
  ASSERT_TRUE(until([&] { return statuses_.size() >= before + 2; }));
  EXPECT_TRUE(distances_.empty());
}

// --- hostile packets

TEST_F(LcmTransportTest, HostilePacketsAndAGoodQueryAfterEach) {
  start();
  set_poses(1, 0.7);
  expect_good_answer();
  RawSender raw(address_.port);
  std::mt19937 random(99);
  const auto noise = [&](std::size_t size) {
    std::vector<std::byte> bytes(size);
    for (auto& b : bytes) b = static_cast<std::byte>(random());
    return bytes;
  };
  const auto with_word = [](std::vector<std::byte> packet, std::size_t from_end, std::uint32_t word) {
    for (int i = 0; i < 4; ++i) packet[packet.size() - from_end + i] = static_cast<std::byte>(word >> (24 - 8 * i));
    return packet;
  };
  const auto cut = [](std::vector<std::byte> packet, std::size_t size) {
    packet.resize(size);
    return packet;
  };
  const auto fragment = [&](std::uint32_t bytes, std::uint32_t offset, std::uint32_t number_and_count) {
    auto packet = RawSender::big_endian({0x4c433033, 7, bytes, offset, number_and_count});
    const auto tail = noise(100);
    packet.insert(packet.end(), tail.begin(), tail.end());
    return packet;
  };

  pose_update_t no_poses{};
  no_poses.publisher_id = 1;
  query_t no_pairs = question();
  clearance_lcm::frame_t no_frame{};
  no_frame.client_id = 5;
  named_pose_update_t no_names{};
  const auto poses = encode(update(2, 0.8));
  const auto query = encode(question());

  // Datagrams that never become a message.
  std::vector<std::pair<std::string, std::vector<std::byte>>> datagrams{
      {"nothing", {}},
      {"noise", noise(1000)},
      {"a whole datagram of noise", noise(65000)},
      {"a header and no more", RawSender::big_endian({0x4c433032, 1})},
      {"a channel that does not end", cut(RawSender::datagram("CLEARANCE_QUERY", {}), 8 + 15)},
      {"a fragment past its message", fragment(1000, 0xFFFFFFF0, 0x00010002)},
      {"a fragment of no fragments", fragment(1000, 0, 0x00010000)},
      {"a fragment of 4 GB", fragment(0xFFFFFFFF, 0, 0x00010002)},
  };
  for (const auto& [what, datagram] : datagrams) {
    SCOPED_TRACE(what);
    raw.send(datagram);
    expect_good_answer();
  }

  // Messages on our channels that are not what the channel is for: each is counted.
  std::vector<std::tuple<std::string, std::string, std::vector<std::byte>>> messages{
      {"an empty message", "CLEARANCE_POSES", {}},
      {"noise for poses", "CLEARANCE_POSES", noise(500)},
      {"noise for a query", "CLEARANCE_QUERY", noise(500)},
      {"a query on the channel of poses", "CLEARANCE_POSES", query},
      {"poses on the channel of queries", "CLEARANCE_QUERY", poses},
      {"37 bytes of poses", "CLEARANCE_POSES", cut(poses, 37)},
      {"poses cut short", "CLEARANCE_POSES", cut(poses, poses.size() - 1)},
      {"poses with bytes left over", "CLEARANCE_POSES", cut(poses, poses.size() + 8)},
      {"2^31 - 1 poses", "CLEARANCE_POSES", with_word(encode(no_poses), 4, 0x7FFFFFFF)},
      {"-1 poses", "CLEARANCE_POSES", with_word(encode(no_poses), 4, 0xFFFFFFFF)},
      {"2^28 names", "CLEARANCE_POSES_NAMED", with_word(encode(no_names), 4, 0x10000000)},
      {"2^31 - 1 pairs", "CLEARANCE_QUERY", with_word(encode(no_pairs), 12, 0x7FFFFFFF)},
      {"2^31 - 1 bodies", "CLEARANCE_QUERY", with_word(encode(no_pairs), 8, 0x7FFFFFFF)},
      {"2^31 - 1 configurations of no body", "CLEARANCE_QUERY", with_word(encode(no_pairs), 4, 0x7FFFFFFF)},
      {"a frame of -1 bytes", "CLEARANCE_FRAME_IN", with_word(encode(no_frame), 4, 0xFFFFFFFF)},
      {"a frame without parts", "CLEARANCE_FRAME_IN", encode(no_frame)},
  };
  for (const auto& [what, channel, packet] : messages) {
    SCOPED_TRACE(what);
    const std::uint64_t bad = counter("lcm.bad_messages");
    raw.send(RawSender::datagram(channel, packet));
    ASSERT_TRUE(until_counter("lcm.bad_messages", bad + 1));
    expect_good_answer();
  }
  EXPECT_EQ(counter("lcm.bad_messages"), messages.size());
  // Bad values in good messages, too.
  pose_update_t bad = update(2, 0.8);
  bad.poses[0] = {std::nan(""), 0, 0, 1, 0, 0, 0};
  bad.poses[1] = {0, 0, 0, 0, 0, 0, 0};
  const std::uint64_t before = counter("lcm.pose_messages");
  publish(bad);
  ASSERT_TRUE(until_counter("lcm.pose_messages", before + 1));
  EXPECT_EQ(engine_->body_state(1).status, Status::kBadPose);
  EXPECT_EQ(engine_->body_state(2).status, Status::kBadPose);
  EXPECT_EQ(engine_->body_state(3).status, Status::kOk);
  expect_good_answer();
}

}  // namespace
}  // namespace clearance
