// Arbitrary UDP packets on the daemon's LCM network, without liblcm's sender: the daemon must still follow poses
// afterwards.
#include <poll.h>

#include <chrono>
#include <iterator>
#include <optional>
#include <vector>

#include "clearance_lcm/pose_update_t.hpp"
#include "server/core/loop.h"
#include "tests/fuzz/frames.h"
#include "tests/lcm/lcm_network.h"
#include "tests/server/test_scene.h"

namespace clearance::fuzz {
namespace {

constexpr const char* kChannels[] = {"CLEARANCE_POSES",        "CLEARANCE_JOINTS",       "CLEARANCE_QUERY",
                                     "CLEARANCE_FRAME_IN",     "CLEARANCE_STATUS",       "OTHER",
                                     "CLEARANCE_MOVING_POSES", "CLEARANCE_MOVING_JOINTS"};

/// A daemon on its own network. It is kept, because opening one takes longer than a thousand inputs.
class Network {
 public:
  Network() : engine_(small_scene(), one_thread()), loop_(engine_) {
    address_.port = free_udp_port();
    loop_.add(make_lcm_transport(address_.url()));
    sender_.emplace(address_.port);
  }

  void send(Bytes datagram) { sender_->send(datagram); }
  /// Runs the daemon until it has processed everything sent so far.
  void drain() {
    clearance_lcm::pose_update_t update{};
    update.publisher_id = publisher_;  // random, so that no input can use its name
    update.sequence = update.stamp_ns = ++sequence_;
    update.count = 1;
    update.names = {engine_.scene().bodies()[1].name};
    update.poses = {{0, 0, 1, 1, 0, 0, 0}};
    std::vector<std::byte> packet(static_cast<std::size_t>(update.getEncodedSize()));
    update.encode(packet.data(), 0, static_cast<int>(packet.size()));
    const auto datagram = RawSender::datagram("CLEARANCE_POSES", packet);
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    auto again = begin;
    while (engine_.body_state(1).stamp_ns != sequence_) {
      if (const auto now = Clock::now(); now >= again) {
        require(now - begin < std::chrono::seconds(20), "the daemon follows poses after bad packets");
        sender_->send(datagram);
        again = now + std::chrono::milliseconds(200);
      }
      if (!loop_.turn()) wait();
    }
    while (loop_.waiting() > 0) loop_.turn();
  }
  std::uint64_t rejected() { return loop_.counter("lcm.bad_messages"); }
  std::uint64_t taken() {
    return loop_.counter("lcm.pose_messages") + loop_.counter("lcm.queries") + loop_.counter("lcm.frames");
  }

 private:
  static engine::Engine::Options one_thread() {
    engine::Engine::Options options;
    options.threads = 1;
    return options;
  }
  /// Waits for a packet, and yields the core to liblcm's thread meanwhile.
  void wait() {
    std::vector<pollfd> readable;
    for (const int fd : loop_.transports()[0]->descriptors()) readable.push_back({fd, POLLIN, 0});
    ::poll(readable.data(), readable.size(), 10);
  }

  LcmAddress address_;
  engine::Engine engine_;
  Loop loop_;
  std::optional<RawSender> sender_;
  std::int64_t publisher_ = draw_lcm_id(), sequence_ = 0;
};

}  // namespace
}  // namespace clearance::fuzz

/// Datagrams, [kind 1 B | its arguments | size 2 B | bytes]. Accepted if the daemon rejected no message and accepted at
/// least one.
CLEARANCE_FUZZ_TARGET(lcm_udp) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static Network network;
  const std::uint64_t rejected = network.rejected(), taken = network.taken();
  Input in(bytes);
  for (int i = 0; !in.empty() && i < 32; ++i) {
    const auto kind = in.number<std::uint8_t>();
    std::vector<std::byte> datagram;
    if (kind % 3 == 1) {  // a short message
      const char* channel = kChannels[in.number<std::uint8_t>() % std::size(kChannels)];
      datagram = RawSender::datagram(channel, in.take(in.number<std::uint16_t>()));
    } else if (kind % 3 == 2) {  // a fragment: sequence, size of the whole, offset, number and count
      const auto sequence = in.number<std::uint32_t>(), size = in.number<std::uint32_t>(),
                 offset = in.number<std::uint32_t>(), numbers = in.number<std::uint32_t>();
      datagram = RawSender::big_endian({0x4c433033, sequence, size, offset, numbers});
      wire::append_bytes(datagram, kChannels[kind % std::size(kChannels)],
                         std::strlen(kChannels[kind % std::size(kChannels)]) + 1);
      const Bytes tail = in.take(in.number<std::uint16_t>());
      wire::append_bytes(datagram, tail.data(), tail.size());
    } else {
      const Bytes raw = in.take(in.number<std::uint16_t>());
      datagram.assign(raw.begin(), raw.end());
    }
    if (datagram.size() <= 65507) network.send(datagram);
  }
  network.drain();
  return network.rejected() == rejected && network.taken() > taken + 1;  // one belongs to `drain()`
}
