// Sends frames with arbitrary bytes to a daemon over each transport, without the client library.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>
#include <zmq.hpp>

#include "tests/server/shm/raw_shm_client.h"
#include "wire/lcm/lcm_bus.h"
#include "wire/lcm/lcm_check.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/protocol.h"

namespace clearance::faults {

/// A received reply.
struct RawReply {
  wire::FrameHeader header;
  wire::ErrorHeader error;  ///< of a kError
};

inline RawReply raw_reply(std::span<const std::byte> frame) {
  RawReply reply;
  if (frame.size() < sizeof reply.header) throw std::runtime_error("a reply without a header");
  std::memcpy(&reply.header, frame.data(), sizeof reply.header);
  if (reply.header.type != static_cast<std::uint16_t>(wire::FrameType::kError)) return reply;
  if (frame.size() < sizeof reply.header + sizeof reply.error) throw std::runtime_error("an error without a code");
  std::memcpy(&reply.error, frame.data() + sizeof reply.header, sizeof reply.error);
  return reply;
}

class RawWire {
 public:
  virtual ~RawWire() = default;
  /// Sends a frame, at least a header long, and waits for its reply. Throws std::runtime_error if none arrives.
  virtual RawReply evaluate(const std::vector<std::byte>& frame) = 0;
};

class RawShmWire final : public RawWire {
 public:
  explicit RawShmWire(const std::string& socket_path) : client_(socket_path) {}
  RawReply evaluate(const std::vector<std::byte>& frame) override {
    const shm::SegmentHeader& header = *client_.header;
    std::memcpy(client_.base + header.request_offset, frame.data(), frame.size());
    ++requested_;
    client_.post(shm::pack_ticket(0, requested_), frame.size(), requested_);
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (header.reply_head.load() != requested_) {
      if (std::chrono::steady_clock::now() > deadline) throw std::runtime_error("no reply");
      std::this_thread::yield();
    }
    return raw_reply(
        {client_.base + header.reply_offset, header.replies[(requested_ - 1) % shm::kRingEntries].frame_bytes.load()});
  }

 private:
  RawClient client_;
  std::uint32_t requested_ = 0;
};

class RawZmqWire final : public RawWire {
 public:
  explicit RawZmqWire(const std::string& url) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::rcvtimeo, 30000);
    socket_.connect(url);
  }
  RawReply evaluate(const std::vector<std::byte>& frame) override {
    const std::size_t head = sizeof(wire::FrameHeader);
    return request_parts({{frame.begin(), frame.begin() + head}, {frame.begin() + head, frame.end()}});
  }
  RawReply request_parts(const std::vector<std::vector<std::byte>>& parts) {
    for (std::size_t i = 0; i < parts.size(); ++i)
      socket_.send(zmq::buffer(parts[i].data(), parts[i].size()),
                   i + 1 < parts.size() ? zmq::send_flags::sndmore : zmq::send_flags::none);
    std::vector<std::byte> reply;
    for (bool more = true; more;) {
      zmq::message_t part;
      if (!socket_.recv(part)) throw std::runtime_error("no reply");
      more = part.more();
      const auto* begin = part.data<std::byte>();
      reply.insert(reply.end(), begin, begin + part.size());
    }
    return raw_reply(reply);
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_{context_, zmq::socket_type::dealer};
};

/// Requests and replies under 48 KB, in one part each. Repeats a request if packets are lost.
class RawLcmWire final : public RawWire {
 public:
  explicit RawLcmWire(const std::string& url) : bus_(parse_lcm_address(url)) {
    bus_.subscribe("CLEARANCE_FRAME_OUT", 64, [this](std::span<const std::byte> packet) {
      clearance_lcm::frame_t part;
      if (!decode_checked(packet, part).empty() || part.client_id != id_ || part.request_id != sequence_) return;
      reply_ = raw_reply(std::as_bytes(std::span(part.bytes)));
    });
  }
  RawReply evaluate(const std::vector<std::byte>& frame) override {
    for (int attempt = 0; attempt < 30; ++attempt) {
      clearance_lcm::frame_t part = frame_part(frame, 0);
      part.client_id = id_;
      part.request_id = ++sequence_;
      part.sequence = sequence_;
      reply_.reset();
      bus_.publish_message("CLEARANCE_FRAME_IN", part);
      const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(1);
      while (!reply_ && bus_.wait(deadline)) bus_.handle();
      if (reply_) return *reply_;
    }
    throw std::runtime_error("no reply");
  }

 private:
  LcmBus bus_;
  std::int64_t id_ = draw_lcm_id(), sequence_ = 0;
  std::optional<RawReply> reply_;
};

}  // namespace clearance::faults
