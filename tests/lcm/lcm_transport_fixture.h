// The daemon's loop on an LCM network, and a planner that uses only the message types; both on one thread.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <random>
#include <set>

#include "clearance_lcm/distances_t.hpp"
#include "clearance_lcm/frame_t.hpp"
#include "clearance_lcm/pose_update_t.hpp"
#include "clearance_lcm/query_t.hpp"
#include "clearance_lcm/reply_t.hpp"
#include "clearance_lcm/scene_t.hpp"
#include "clearance_lcm/states_t.hpp"
#include "clearance_lcm/status_t.hpp"
#include "engine/engine.h"
#include "server/core/loop.h"
#include "server/requests/transport.h"
#include "tests/lcm/lcm_fixture.h"

namespace clearance {

using clearance_lcm::distances_t;
using clearance_lcm::pose_update_t;
using clearance_lcm::query_t;
using clearance_lcm::reply_t;
using clearance_lcm::scene_t;
using clearance_lcm::states_t;
using clearance_lcm::status_t;

inline constexpr int kMoving = 6;

/// A static table and six balls; "arm" is the first three.
inline engine::Scene make_scene() {
  engine::Scene scene;
  engine::Scene::BodyOptions table;
  table.is_static = true;
  table.pose = Pose{{0, 0, -1}, 1, 0, 0, 0};
  scene.add_box("table", {4, 4, 0.5}, table);
  for (int i = 0; i < kMoving; ++i) scene.add_sphere("ball" + std::to_string(i), 0.1 + 0.01 * i, {});
  const std::vector<std::string> arm{"ball0", "ball1", "ball2"};
  scene.add_group("arm", arm);
  return scene;
}

/// Position of ball i in step k, far enough from the others to avoid contact.
inline std::vector<double> pose_of(int ball, double step) {
  return {1.0 * ball + 0.25 * std::sin(step + ball), 0.5 * std::cos(2 * step), 0.1 * ball, 1, 0.1 * ball, 0.2, 0.3};
}

/// An answer with all its parts, columns joined.
struct Answer {
  reply_t whole;
  std::set<int> parts;
};

class LcmTransportTest : public LcmTest {
 protected:
  void start(const std::string& options = "", const LcmPoses& poses = {}, engine::Scene scene = make_scene()) {
    engine_.emplace(std::move(scene), engine::Engine::Options{.threads = 1});
    loop_.emplace(*engine_);
    loop_->add(make_lcm_transport(url(options), poses));
    bus_.emplace(address_);
    bus_->subscribe("CLEARANCE_REPLY", 4096, [this](auto packet) { on_reply(packet); });
    bus_->subscribe("CLEARANCE_SCENE", 64, [this](auto packet) { keep(scenes_, packet); });
    bus_->subscribe("CLEARANCE_STATUS", 64, [this](auto packet) { keep(statuses_, packet); });
    bus_->subscribe("CLEARANCE_STATES", 64, [this](auto packet) { keep(states_, packet); });
    bus_->subscribe("CLEARANCE_DISTANCES", 64, [this](auto packet) { keep(distances_, packet); });
  }

  /// Runs the daemon's loop and receives the planner's messages until `done`; false after kPatience.
  bool until(const std::function<bool()>& done) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
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
      message.names.push_back("ball" + std::to_string(i));
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

  query_t query_message() {
    query_t query{};
    query.client_id = 4242;
    query.request_id = ++last_request_;
    return query;
  }
  /// Returns the whole answer, and repeats the query if a part was lost.
  std::optional<reply_t> evaluate(query_t query) {
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
    query_t query = query_message();
    query.pair_count = 1;
    query.pairs = {{1, 2}};
    const auto reply = evaluate(query);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->error_code, 0) << reply->error_text;
    EXPECT_EQ(reply->distance.size(), 1u);
  }

  std::optional<engine::Engine> engine_;
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
      // On one host parts arrive in order, so columns can simply be joined.
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
    join(whole.points32, part.points32);
    join(whole.bounds, part.bounds);
  }
};

}  // namespace clearance
