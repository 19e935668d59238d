// A shared-memory client that violates the protocol: arbitrary messages on the socket, and arbitrary words and frames
// in its segment, between any two steps of the daemon. Its own connection may end; the next client is served, and
// nothing of the first one remains.
#include <sys/mman.h>

#include <array>

#include "server/core/loop.h"
#include "server/shm/shm_transport.h"
#include "tests/fuzz/frames.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/server/core/memory_transport.h"
#include "tests/server/test_scene.h"
#include "wire/shm_os.h"

namespace clearance::fuzz {
namespace {

ShmLimits small_limits() {
  ShmLimits limits;
  limits.slots = 4;
  limits.request_capacity = 4 * shm::kPage;
  limits.reply_capacity = 4 * shm::kPage;
  limits.max_segment_bytes = 1 << 20;
  limits.pool_bytes = 4 << 20;
  limits.max_segments_per_client = 2;
  return limits;
}

/// A client without the client library.
class HandClient {
 public:
  explicit HandClient(const std::string& path) {
    sockaddr_un address;
    require(shm::socket_address(path.c_str(), address), "the socket's path is short");
    socket_.reset(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    require(::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0,
            "the daemon takes a connection");
  }
  ~HandClient() { unmap(); }
  HandClient(const HandClient&) = delete;

  void send(Bytes bytes) {
    [[maybe_unused]] const auto sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  void send(shm::MessageKind kind, std::uint32_t segment = 0, std::uint64_t request = 0, std::uint64_t reply = 0) {
    shm::Message message;
    message.wire_version = wire::kVersion;
    message.kind = static_cast<std::uint32_t>(kind);
    message.segment_id = segment;
    message.request_capacity = request;
    message.reply_capacity = reply;
    send(std::as_bytes(std::span(&message, 1)));
  }
  /// Receives a message and maps its segment, if any. Returns the message's kind, or 0 if there is none.
  std::uint32_t receive() {
    shm::Message message;
    std::array<shm::UniqueFd, shm::kMaxPassedFds> fds;
    if (shm::receive_message(socket_.get(), message, &fds) <= 0) return 0;
    if (fds[0]) {
      unmap();
      bytes_ = static_cast<std::size_t>(::lseek(fds[0].get(), 0, SEEK_END));
      base_ = static_cast<std::byte*>(::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, fds[0].get(), 0));
      require(base_ != MAP_FAILED, "a segment can be mapped");
      capacity_ = message.request_capacity;  // the daemon's value; the segment may change later
      slots_ = header().slot_count;
      posted_ = 0;
      generations_ = {};
    }
    return message.kind;
  }
  bool has_segment() const { return base_ != nullptr; }
  const shm::SegmentHeader& header() const { return *reinterpret_cast<const shm::SegmentHeader*>(base_); }

  void scribble(std::uint32_t at, Bytes bytes) {
    if (base_ == nullptr) return;
    at %= bytes_;
    std::memcpy(base_ + at, bytes.data(), std::min(bytes.size(), bytes_ - at));
  }
  /// Posts a frame according to the rules.
  void post(std::uint32_t slot, Bytes frame) {
    if (base_ == nullptr) return;
    auto& header = *reinterpret_cast<shm::SegmentHeader*>(base_);
    slot %= slots_;
    std::memcpy(base_ + shm::kPage + slot * capacity_, frame.data(), std::min<std::size_t>(frame.size(), capacity_));
    shm::RingEntry& entry = header.requests[posted_ % shm::kRingEntries];
    entry.ticket.store(shm::pack_ticket(slot, ++generations_[slot]));
    entry.frame_bytes.store(frame.size());
    header.request_head.store(++posted_);
  }

 private:
  void unmap() {
    if (base_ != nullptr) ::munmap(base_, bytes_);
    base_ = nullptr;
  }
  shm::UniqueFd socket_;
  std::byte* base_ = nullptr;
  std::size_t bytes_ = 0;
  std::uint64_t capacity_ = 0;
  std::uint32_t slots_ = 1, posted_ = 0;
  std::array<std::uint32_t, shm::kMaxSlots> generations_{};
};

/// Runs the daemon until it is idle. At a tick it polls its sockets: first it accepts a connection, then its messages,
/// then it releases ended ones.
void serve(Loop& loop) {
  for (int look = 0; look < 3; ++look) {
    loop.transports()[0]->tick(loop);
    while (loop.turn()) {
    }
  }
}

}  // namespace
}  // namespace clearance::fuzz

/// Steps, [kind 1 B | its arguments]. Accepted if no rule was broken.
CLEARANCE_FUZZ_TARGET(shm_server) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  const std::string path = folder / "s";
  engine::Engine::Options options;
  options.threads = 1;
  static const engine::Scene scene = small_scene();
  engine::Engine engine(scene, options);
  Loop::Options every_turn = on_one_thread();  // queries that wait for poses are released at a tick
  every_turn.tick = std::chrono::nanoseconds(0);
  Loop loop(engine, every_turn);
  loop.add(make_shm_transport(path, small_limits()));
  auto client = std::make_unique<HandClient>(path);

  Input in(bytes);
  for (int step = 0; !in.empty() && step < 64; ++step) switch (in.number<std::uint8_t>() % 8) {
      case 0:
        serve(loop);
        client->receive();
        break;
      case 1:
        client->send(shm::MessageKind::kHello);
        break;
      case 2: {
        const auto kind = in.number<std::uint8_t>();
        const auto segment = in.number<std::uint32_t>();
        const auto request = in.number<std::uint64_t>();
        client->send(shm::MessageKind{kind}, segment, request, in.number<std::uint64_t>());
        break;
      }
      case 3:
        client->send(in.take(in.number<std::uint16_t>()));
        break;
      case 4: {
        const auto at = in.number<std::uint32_t>();
        client->scribble(at, in.take(in.number<std::uint16_t>()));
        break;
      }
      case 5: {
        const auto slot = in.number<std::uint8_t>();
        client->post(slot, next_frame(in).bytes);
        break;
      }
      case 6:
        loop.turn();
        break;
      case 7:
        client = std::make_unique<HandClient>(path);
        break;
    }
  serve(loop);
  const bool accepted = client->has_segment() && loop.counter("shm.violations") == 0 &&
                        loop.counter("shm.rejected") == 0 && loop.counter("errors") == 0;
  client.reset();
  serve(loop);
  // Its last message may still be in its socket, which is read in portions; and the worker unmaps segments after the
  // tick that releases them, so that only the next tick counts them as returned.
  const auto is_there = [&] { return loop.counter("shm.clients") > 0 || loop.counter("shm.segment_bytes") > 0; };
  for (int look = 0; is_there() && look < 100; ++look) serve(loop);
  require(loop.counter("shm.clients") == 0, "a client that is gone is no client any more");
  require(loop.counter("shm.segment_bytes") == 0, "the segments of a client that is gone are given back");

  HandClient good(path);
  good.send(shm::MessageKind::kHello);
  serve(loop);
  require(good.receive() == static_cast<std::uint32_t>(shm::MessageKind::kSegment), "the next client is greeted");
  wire::FrameHeader ping = wire::make_header(wire::FrameType::kPing, 1, 0);
  good.post(0, std::as_bytes(std::span(&ping, 1)));
  serve(loop);
  require(good.header().reply_head.load() == 1 && good.header().replies[0].ticket.load() == shm::pack_ticket(0, 1) &&
              good.header().replies[0].frame_bytes.load() == sizeof ping + wire::kEpochRecordBytes,
          "the next client is answered");
  return accepted;
}
