// A connection over LCM: frames in parts, sent on CLEARANCE_FRAME_IN and received on CLEARANCE_FRAME_OUT.
//
// LCM has no connections: the loss of a daemon is not reported, and any part can be lost. A frame arrives completely or
// not at all, which the receiver detects by its deadline. Every daemon of the network receives each request, so the
// channel is bound to one of them by its server id, and accepts answers of that one only.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <set>
#include <stdexcept>
#include <thread>
#include <unordered_map>
#include <unordered_set>

#include "client/channel/channel.h"
#include "client/channel/connection_errors.h"
#include "wire/aligned_buffer.h"
#include "wire/lcm/lcm_bus.h"
#include "wire/lcm/lcm_check.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {
namespace {

constexpr std::uint64_t kMaxRequestBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kMaxReplyBytes = std::uint64_t{64} << 20;
/// Maximum messages in liblcm between two calls of receive(): parts of 24 MB.
constexpr int kQueue = 512;
constexpr std::chrono::milliseconds kRequestAgain{200};
/// Time to wait for greetings of further daemons after the first.
constexpr std::chrono::milliseconds kSettle{50};
/// Silence of the bound daemon after which another daemon's rejection is the answer.
constexpr std::chrono::milliseconds kSilence{500};
/// Request ids of greetings, distinct from those of Connection's own requests.
constexpr std::uint64_t kGreetings = kOwnRequests | std::uint64_t{1} << 60;

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
    // This client's replies have its id in the second field after the type's hash; others are not decoded.
    bus_.subscribe("CLEARANCE_FRAME_OUT", kQueue, [this](std::span<const std::byte> packet) {
      if (client_id_of(packet) == client_id_) take(packet);
    });
    bind(deadline);
  }

  /// Pings until a daemon responds, since it may still be starting and packets can be lost. Stays with the bound daemon
  /// if that one responds.
  void bind(Deadline deadline) override {
    greeted_.clear();
    first_greeting_ = next_greeting_;
    while (greeted_.empty()) {
      if (Deadline::clock::now() >= deadline)
        throw ConnectionError(url_ +
                              ": no daemon answers; is clearanced running with --lcm and this group, port and prefix?");
      ping(next_greeting_++);
      const Deadline again = std::min(deadline, Deadline::clock::now() + kRequestAgain);
      while (greeted_.empty() && pump(again)) {
      }
    }
    for (const Deadline settled = Deadline::clock::now() + kSettle; pump(settled);) {
    }
    if (greeted_.contains(server_id_)) return;
    if (greeted_.size() > 1) throw ConnectionError(url_ + several_answer());
    server_id_ = *greeted_.begin();
    for (auto& [request_id, rejection] : rejections_) {
      if (outstanding_.erase(request_id)) kept_[request_id] = std::move(rejection);
    }
    rejections_.clear();
    silent_since_.reset();
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
        throw ConnectionError(url_ + ": the system cannot send it (" + std::strerror(errno) + ")");
      }
      pacer_.sent(part.bytes.size());
    }
  }

  std::unique_ptr<Frame> receive(std::uint64_t request_id, Deadline deadline) override {
    while (true) {
      while (!kept_.contains(request_id) && handle()) {
      }
      if (probe_due_) sign_of_life();
      if (auto frame = take_out(kept_, request_id)) return frame;
      const bool is_rejected = rejections_.contains(request_id);
      const Deadline silent = is_rejected ? *silent_since_ + kSilence : Deadline::max();
      if (Deadline::clock::now() >= silent) {
        outstanding_.erase(request_id);
        return take_out(rejections_, request_id);
      }
      if (!bus_.wait(std::min(deadline, silent)) && Deadline::clock::now() >= deadline) return nullptr;
    }
  }

  void forget(std::uint64_t request_id) override {
    outstanding_.erase(request_id);
    kept_.erase(request_id);
    rejections_.erase(request_id);
  }

  std::string url() const override { return url_; }
  bool may_lose() const override { return true; }

  /// Counts the parts from the bound daemon; requests an echo to get one.
  std::uint64_t sign_of_life() override {
    probe_due_ = false;
    ping(kSignRequest);
    return arrived_ + 1;
  }

 private:
  static std::int64_t client_id_of(std::span<const std::byte> packet) {
    if (packet.size() < 24) return 0;
    std::uint64_t id = 0;
    for (std::size_t i = 16; i < 24; ++i) id = id << 8 | std::to_integer<std::uint64_t>(packet[i]);
    return static_cast<std::int64_t>(id);
  }

  using Frames = std::unordered_map<std::uint64_t, std::unique_ptr<Frame>>;
  static std::unique_ptr<Frame> take_out(Frames& frames, std::uint64_t request_id) {
    auto node = frames.extract(request_id);
    return node ? std::move(node.mapped()) : nullptr;
  }

  /// Requests an echo as a sign of life.
  void ping(std::uint64_t request_id) {
    const wire::FrameHeader header = wire::make_header(wire::FrameType::kPing, request_id, 0);
    std::memcpy(begin(sizeof header, 0), &header, sizeof header);
    send();
    forget(request_id);
  }

  /// Receives one waiting message; returns false if there is none.
  bool handle() {
    try {
      return bus_.handle();
    } catch (const std::runtime_error& error) {
      throw ConnectionError(url_ + ": " + error.what());
    }
  }
  /// Receives one message, waiting if necessary; returns false after `deadline`.
  bool pump(Deadline deadline) { return Deadline::clock::now() < deadline && (handle() || bus_.wait(deadline)); }

  std::string several_answer() const {
    std::string ids;
    for (const std::int64_t id : greeted_) ids += (ids.empty() ? "" : ", ") + std::to_string(id);
    return ": " + std::to_string(greeted_.size()) + " daemons answer under the same channels (server ids " + ids +
           "), and each has poses of its own; give each a prefix of its own (prefix= in the url)";
  }

  /// Handles a part for this client. Drops malformed and late parts and those of other requests, since every program on
  /// the network can send.
  void take(std::span<const std::byte> packet) {
    clearance_lcm::frame_t part;
    if (!decode_checked(packet, part).empty()) return;
    const bool is_bound = part.server_id == server_id_;
    if (is_bound) {
      ++arrived_;
      silent_since_.reset();
      rejections_.clear();
    }
    const auto request_id = static_cast<std::uint64_t>(part.request_id);
    if (request_id >= first_greeting_ && request_id < next_greeting_) greeted_.insert(part.server_id);
    // Rejections of other daemons are short. Their answers to clients without an epoch are not joined.
    if (!outstanding_.contains(request_id) || (!is_bound && part.parts != 1)) return;
    auto whole = assembler_.add(part, FrameAssembler::Clock::now());
    if (!whole) return;
    try {
      auto frame = std::make_unique<LcmFrame>(std::move(whole->frame));
      if (frame->header().request_id != request_id) return;
      if (!is_bound) return hold_rejection(request_id, std::move(frame));
      outstanding_.erase(request_id);
      kept_[request_id] = std::move(frame);
    } catch (const wire::WireError&) {
      return;
    }
  }

  /// Keeps the kNewEpoch of another daemon, and pings the bound one. If that is lost, perhaps restarted with another
  /// server id, the kNewEpoch is the answer.
  void hold_rejection(std::uint64_t request_id, std::unique_ptr<Frame> frame) {
    if (frame->header().type != static_cast<std::uint16_t>(wire::FrameType::kError)) return;
    const auto error = wire::parse_error(wire::split_payload(frame->header(), frame->payload()).body);
    if (error.header.code != static_cast<std::uint16_t>(wire::ErrorCode::kNewEpoch)) return;
    if (!silent_since_) {
      silent_since_ = Deadline::clock::now();
      probe_due_ = true;
    }
    rejections_[request_id] = std::move(frame);
  }

  LcmBus bus_;
  std::string url_;
  std::int64_t client_id_ = draw_lcm_id();
  std::int64_t sequence_ = 0;
  std::int64_t server_id_ = 0;      // of the bound daemon, or 0
  std::set<std::int64_t> greeted_;  // daemons that responded to the last bind()
  std::uint64_t first_greeting_ = kGreetings, next_greeting_ = kGreetings;
  std::uint64_t arrived_ = 0;             // parts from the bound daemon
  std::optional<Deadline> silent_since_;  // first rejection by another daemon since the bound one's last part
  bool probe_due_ = false;
  LcmPacer pacer_;
  FrameBytes room_;
  FrameAssembler assembler_{{.frame_bytes = kMaxReplyBytes, .total_bytes = 4 * kMaxReplyBytes, .frames = 1024}};
  std::unordered_set<std::uint64_t> outstanding_;
  Frames kept_;
  Frames rejections_;  // kNewEpoch of other daemons, by outstanding request
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
