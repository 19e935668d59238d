// A loop whose scene can be changed, and requests that change it.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/server/body_frames.h"
#include "tests/server/core/loop_fixture.h"

namespace clearance {

class Bodies : public LoopTest {
 protected:
  void start_editable(engine::Scene scene, Loop::Options options = {}) {
    start(std::move(scene), options);
    loop_->reload_by([] { return std::make_unique<engine::Engine>(small_scene()); },
                     [this](engine::Scene next) {
                       ++built_;
                       while (hold_) std::this_thread::yield();
                       return std::make_unique<engine::Engine>(std::move(next), engine::Engine::Options{.threads = 1});
                     });
  }
  std::unique_ptr<MemoryFrame> request_scene(MemoryClient& client, std::vector<std::byte> frame) {
    transport_->send(client, std::move(frame));
    while (client.replies.empty()) loop_->turn();
    return take(client);
  }
  wire::SceneChange change(std::vector<std::byte> frame) {
    const auto reply = request_scene(a_, std::move(frame));
    EXPECT_EQ(reply->type(), wire::FrameType::kSceneChanged);
    if (reply->type() != wire::FrameType::kSceneChanged) return {};
    return wire::parse_scene_changed(wire::split_payload(reply->header(), reply->payload()).body);
  }
  /// The rejection's message; checks that the scene is unchanged.
  std::string rejection(std::vector<std::byte> frame, wire::ErrorCode code = wire::ErrorCode::kBadQuery) {
    const std::uint64_t before = loop_->engine().scene_revision();
    const auto error = error_of(request_scene(a_, std::move(frame)));
    EXPECT_EQ(static_cast<wire::ErrorCode>(error.header.code), code) << error.text;
    EXPECT_EQ(loop_->engine().scene_revision(), before);
    return error.text;
  }
  const std::vector<Body>& bodies() { return loop_->engine().scene().bodies(); }

  std::atomic<int> built_{0};
  std::atomic<bool> hold_{false};
};

}  // namespace clearance
