// A loop, an in-memory transport, and clients: requests, turns of the loop, and replies on one thread.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>

#include "server/core/loop.h"
#include "tests/server/core/memory_transport.h"
#include "tests/server/test_scene.h"

namespace clearance {

using namespace std::chrono_literals;

/// A loop over an engine, with one in-memory transport and the clients of a test.
class LoopTest : public testing::Test {
 protected:
  /// Without a worker thread: the loop also does the worker's share, so that its turns can be counted.
  void start(engine::Scene scene, Loop::Options options = {}, int threads = 1) {
    options.worker_thread = with_worker_;
    engine::Engine::Options engine_options;
    engine_options.threads = threads;
    engine_ = std::make_unique<engine::Engine>(std::move(scene), engine_options);
    loop_ = std::make_unique<Loop>(*engine_, options);
    auto transport = std::make_unique<MemoryTransport>();
    transport_ = transport.get();
    loop_->add(std::move(transport));
  }
  /// Each turn works on one query, for a short slice.
  static Loop::Options short_slices() {
    Loop::Options options;
    options.slice = 1ns;
    return options;
  }
  /// Runs the loop until a large query has been read, its pairs are listed and its reply has memory. With
  /// short_slices() it then runs for long.
  void turn_until_it_runs() {
    for (int i = 0; i < 10; ++i) loop_->turn();
  }
  void turn_until_idle() {
    while (loop_->turn()) {
    }
  }
  std::unique_ptr<MemoryFrame> take(MemoryClient& client) {
    EXPECT_FALSE(client.replies.empty());
    if (client.replies.empty()) return nullptr;
    auto frame = std::move(client.replies.front());
    client.replies.pop_front();
    return frame;
  }
  /// Sends a frame, serves, and returns the one reply.
  std::unique_ptr<MemoryFrame> evaluate(MemoryClient& client, std::vector<std::byte> frame) {
    transport_->send(client, std::move(frame));
    turn_until_idle();
    return take(client);
  }
  Result evaluate(MemoryClient& client, const TestQuery& query) { return result_of(evaluate(client, query.frame(1))); }
  static wire::ErrorParts error_of(const std::unique_ptr<MemoryFrame>& frame) {
    EXPECT_EQ(frame->type(), wire::FrameType::kError);
    return wire::parse_error(frame->body());
  }

  bool with_worker_ = false;
  MemoryClient a_, b_, c_;  // declared before the loop, which may hold their requests until its end
  std::unique_ptr<engine::Engine> engine_;
  std::unique_ptr<Loop> loop_;
  MemoryTransport* transport_ = nullptr;
};

/// A query that takes some hundred slices in the scattered scene.
inline TestQuery large_query(int bodies) {
  TestQuery query;
  for (int k = 0; k < 40; ++k)
    for (int b = 0; b < bodies; ++b) {
      if (k == 0) query.bodies.push_back(static_cast<std::uint32_t>(b));
      query.configurations.push_back({0.3 * b, 0.1 * k, 0.2 * b, 1, 0, 0, 0});
    }
  return query;
}
inline TestQuery small_query() {
  TestQuery query;
  query.pairs = {{0, 1}};
  return query;
}
/// A small query that waits until body 1 has a pose with a stamp of 1000 or newer.
inline TestQuery waiting_query() {
  TestQuery query = small_query();
  query.header.min_pose_stamp_ns = 1000;
  query.header.deadline_ns = 10'000'000'000;
  query.header.wait_for = 1;
  return query;
}

}  // namespace clearance
