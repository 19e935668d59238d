// A connection over LCM: frames in parts, out on CLEARANCE_FRAME_IN and back on CLEARANCE_FRAME_OUT.
//
// There is no connection underneath: nothing says that the daemon is gone, and any part may be lost. A frame arrives
// whole or not at all; one that does not arrive is a deadline passed.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <unordered_map>
#include <unordered_set>

#include "channel.h"
#include "client.h"
#include "wire/aligned_buffer.h"
#include "wire/lcm_bus.h"
#include "wire/lcm_check.h"
#include "wire/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {
namespace {

constexpr std::uint64_t kMaxRequestBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kMaxReplyBytes = std::uint64_t{64} << 20;
/// Messages that liblcm keeps between two calls of receive(): parts of 24 MB.
constexpr int kQueue = 512;
constexpr std::chrono::milliseconds kAskAgain{200};

class LcmFrame final : public Frame {
 public:
  explicit LcmFrame(FrameBytes bytes) : bytes_(std::move(bytes)) {
    payload_ = wire::split_frame(bytes_.span(), header_);
  }
  const wire::FrameHeader& header() const override { return header_; }
  std::span<const std::byte> payload() const override { return payload_; }

 private:
  FrameBytes bytes_;
  wire::FrameHeader header_;
  std::span<const std::byte> payload_;
};

class LcmChannel final : public Channel {
 public:
  LcmChannel(const LcmAddress& address, Deadline deadline) : bus_(address), url_(address.url()) {
    // Our own replies are known by the client's id, the second field behind the type's hash; the others' are not
    // decoded.
    bus_.subscribe("CLEARANCE_FRAME_OUT", kQueue, [this](std::span<const std::byte> packet) {
      if (client_id_of(packet) == client_id_) take(packet);
    });
    greet(deadline);
  }

  std::byte* begin(std::uint64_t frame_bytes, std::uint64_t) override {
    if (frame_bytes > kMaxRequestBytes) {
      throw RequestError(static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge),
                         url_ + ": a request of " + std::to_string(frame_bytes) + " bytes; over LCM at most " +
                             std::to_string(kMaxRequestBytes));
    }
    if (room_.size < frame_bytes) room_ = FrameBytes(frame_bytes);
    return room_.bytes.get();
  }

  void send() override {
    wire::FrameHeader header;
    std::memcpy(&header, room_.bytes.get(), sizeof header);
    header.client_id = static_cast<std::uint64_t>(client_id_);
    std::memcpy(room_.bytes.get(), &header, sizeof header);
    const std::span<const std::byte> frame(room_.bytes.get(), sizeof header + header.payload_bytes);
    outstanding_.insert(header.request_id);
    ++sequence_;
    const std::uint64_t parts = frame_part_count(frame.size());
    for (std::uint64_t i = 0; i < parts; ++i) {
      while (!pacer_.ready(LcmPacer::Clock::now())) std::this_thread::sleep_for(pacer_.pause());
      clearance_lcm::frame_t part = frame_part(frame, i);
      part.client_id = client_id_;
      part.request_id = static_cast<std::int64_t>(header.request_id);
      part.sequence = sequence_;
      if (!bus_.publish_message("CLEARANCE_FRAME_IN", part)) {
        outstanding_.erase(header.request_id);
        throw ConnectionError(url_ + ": the system refused to send (" + std::strerror(errno) + ")");
      }
      pacer_.sent(part.bytes.size());
    }
  }

  std::unique_ptr<Frame> receive(std::uint64_t request_id, Deadline deadline) override {
    while (true) {
      try {
        while (!kept_.contains(request_id) && bus_.handle()) {
        }
      } catch (const std::runtime_error& error) {
        throw ConnectionError(url_ + ": " + error.what());
      }
      if (const auto found = kept_.find(request_id); found != kept_.end()) {
        std::unique_ptr<Frame> frame = std::move(found->second);
        kept_.erase(found);
        return frame;
      }
      if (!bus_.wait(deadline)) return nullptr;
    }
  }

  void forget(std::uint64_t request_id) override {
    outstanding_.erase(request_id);
    kept_.erase(request_id);
  }

  std::string url() const override { return url_; }
  bool may_lose() const override { return true; }

  /// Parts that came for us; where none comes, an echo brings one.
  std::uint64_t sign_of_life() override {
    const wire::FrameHeader echo = wire::make_header(wire::FrameType::kPing, kSignRequest, 0);
    std::memcpy(begin(sizeof echo, 0), &echo, sizeof echo);
    send();
    forget(kSignRequest);
    return arrived_ + 1;
  }

 private:
  static std::int64_t client_id_of(std::span<const std::byte> packet) {
    if (packet.size() < 24) return 0;
    std::uint64_t id = 0;
    for (std::size_t i = 16; i < 24; ++i) id = id << 8 | std::to_integer<std::uint64_t>(packet[i]);
    return static_cast<std::int64_t>(id);
  }

  /// A part for us. What is malformed, late or of another request is dropped: anybody may send on this network.
  void take(std::span<const std::byte> packet) {
    clearance_lcm::frame_t part;
    if (!decode_checked(packet, part).empty()) return;
    ++arrived_;
    const auto request_id = static_cast<std::uint64_t>(part.request_id);
    if (!outstanding_.contains(request_id)) return;
    auto whole = assembler_.add(part, FrameAssembler::Clock::now());
    if (!whole) return;
    try {
      auto frame = std::make_unique<LcmFrame>(std::move(whole->frame));
      if (frame->header().request_id != request_id) return;
      outstanding_.erase(request_id);
      kept_[request_id] = std::move(frame);
    } catch (const wire::WireError&) {
      return;
    }
  }

  /// Pings until the daemon answers: it may not be up yet, and the first packets may be lost.
  void greet(Deadline deadline) {
    for (std::uint64_t id = kOwnRequests;; ++id) {
      const wire::FrameHeader header = wire::make_header(wire::FrameType::kPing, id, 0);
      std::memcpy(begin(sizeof header, 0), &header, sizeof header);
      send();
      const bool answered = receive(id, std::min(deadline, Deadline::clock::now() + kAskAgain)) != nullptr;
      forget(id);
      if (answered) return;
      if (Deadline::clock::now() >= deadline) {
        throw ConnectionError(url_ +
                              ": no daemon answers; is clearanced running with --lcm and this group, port and prefix?");
      }
    }
  }

  LcmBus bus_;
  std::string url_;
  std::int64_t client_id_ = draw_lcm_id();
  std::int64_t sequence_ = 0;
  std::uint64_t arrived_ = 0;  // parts
  LcmPacer pacer_;
  FrameBytes room_;
  FrameAssembler assembler_{{.frame_bytes = kMaxReplyBytes, .total_bytes = 4 * kMaxReplyBytes, .frames = 1024}};
  std::unordered_set<std::uint64_t> outstanding_;
  std::unordered_map<std::uint64_t, std::unique_ptr<Frame>> kept_;
};

}  // namespace

std::unique_ptr<Channel> open_lcm_channel(const std::string& lcm_url, const std::string& channel_prefix,
                                          Deadline deadline) {
  LcmAddress address = parse_lcm_address(lcm_url);
  if (!channel_prefix.empty()) address.prefix = channel_prefix;
  try {
    return std::make_unique<LcmChannel>(address, deadline);
  } catch (const ConnectionError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw ConnectionError(address.url() + ": " + error.what());
  }
}

}  // namespace clearance
