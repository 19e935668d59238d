// A daemon's loop with one client: it replies to recorded requests (tests/golden) and to seeds of the fuzzer.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "tests/fuzz/changing_scene.h"
#include "tests/server/core/memory_transport.h"

namespace clearance::fuzz {

/// A loop over a scene on one CPU thread, without a device.
class Conversation {
 public:
  explicit Conversation(engine::Scene scene) {
    engine::Engine::Options options;
    options.backend = "cpu";
    options.threads = 1;
    engine_ = std::make_unique<engine::Engine>(std::move(scene), options);
    loop_ = std::make_unique<Loop>(*engine_, on_one_thread());
    serve_changing_scenes(*loop_);
    auto transport = std::make_unique<MemoryTransport>();
    transport_ = transport.get();
    loop_->add(std::move(transport));
  }
  /// Returns the reply to a request: header and payload.
  std::vector<std::byte> reply_to(const std::vector<std::byte>& request) {
    transport_->send(client_, request);
    while (client_.replies.empty()) loop_->turn();  // a query that waits for poses takes several turns
    const MemoryFrame& got = *client_.replies.front();
    std::vector<std::byte> reply;
    wire::append(reply, got.header());
    wire::append_bytes(reply, got.payload().data(), got.payload().size());
    client_.replies.pop_front();
    return reply;
  }

 private:
  MemoryClient client_;
  std::unique_ptr<engine::Engine> engine_;
  std::unique_ptr<Loop> loop_;
  MemoryTransport* transport_ = nullptr;
};

}  // namespace clearance::fuzz
