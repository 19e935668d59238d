// A connection over ZeroMQ, from a DEALER to the daemon's ROUTER, with frames as two message parts.
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "client/channel/channel.h"
#include "client/channel/connection_errors.h"
#include "wire/aligned_buffer.h"
#include "wire/wire.h"
#include "wire/zmq_calls.h"

namespace clearance {
namespace {

/// Minimum size of payloads that ZeroMQ gets without a copy.
constexpr std::uint64_t kHandOverBytes = 64 * 1024;
/// Maximum number of requests without a reply, for whose replies the daemon has queue space.
constexpr std::size_t kMostOutstanding = 1000;
/// Interval between reads of the monitor while waiting, and so the maximum delay to detect a daemon's death.
constexpr std::chrono::milliseconds kPollNap{10};

class ZmqFrame final : public Frame {
 public:
  ZmqFrame(const wire::FrameHeader& header, zmq::message_t payload) : header_(header), message_(std::move(payload)) {
    data_ = message_.data<std::byte>();
    // ZeroMQ does not align messages; small ones stay in its receive buffer.
    if (reinterpret_cast<std::uintptr_t>(data_) % wire::kColumnAlignment && message_.size()) {
      copy_ = aligned_bytes(message_.size());
      std::memcpy(copy_.get(), data_, message_.size());
      data_ = copy_.get();
    }
  }
  const wire::FrameHeader& header() const override { return header_; }
  std::span<const std::byte> payload() const override {
    return {data_, static_cast<std::size_t>(header_.payload_bytes)};
  }

 private:
  wire::FrameHeader header_;
  zmq::message_t message_;
  AlignedBytes copy_;
  const std::byte* data_ = nullptr;
};

class ZmqChannel final : public Channel {
 public:
  ZmqChannel(const std::string& endpoint, const ChannelKeys& keys, Deadline deadline)
      : endpoint_(endpoint),
        with_keys_(!keys.server.empty()),
        socket_(context_, zmq::socket_type::dealer),
        monitor_(context_, zmq::socket_type::pair) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(wire::kMaxFrameBytes));
    // No reconnection: a lost daemon is an error, since a new one can have another scene.
    socket_.set(zmq::sockopt::reconnect_ivl, -1);
    if (with_keys_) {
      set_key(ZMQ_CURVE_SERVERKEY, keys.server);
      set_key(ZMQ_CURVE_PUBLICKEY, keys.own.public_key);
      set_key(ZMQ_CURVE_SECRETKEY, keys.own.secret_key);
    }
    monitor_.set(zmq::sockopt::linger, 0);
    const int events = ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |
                       ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH | ZMQ_EVENT_CLOSED |
                       ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_CONNECT_RETRIED;
    if (zmq_socket_monitor(socket_.handle(), "inproc://events", events)) fail(zmq_strerror(zmq_errno()));
    monitor_.connect("inproc://events");
    try {
      socket_.connect(endpoint);
    } catch (const zmq::error_t& error) {
      fail(error.what());
    }
    while (!connected_) {
      if (gone_) fail(why_rejected());
      if (!wait(monitor_only_, deadline)) fail("no daemon answered in time");
      read_events();
    }
  }

  std::byte* begin(std::uint64_t frame_bytes, std::uint64_t) override {
    if (frame_bytes > room_bytes_) {
      room_ = aligned_bytes(frame_bytes);
      room_bytes_ = frame_bytes;
    }
    return room_.get();
  }

  void send() override {
    wire::FrameHeader header;
    std::memcpy(&header, room_.get(), sizeof header);
    zmq::message_t first(&header, sizeof header), second;
    std::byte* payload = room_.get() + sizeof header;
    if (header.payload_bytes >= kHandOverBytes) {
      second.rebuild(payload, header.payload_bytes, [](void*, void* room) { std::free(room); }, room_.get());
      (void)room_.release();
      room_bytes_ = 0;
    } else {
      second.rebuild(payload, header.payload_bytes);
    }
    if (outstanding_.size() >= kMostOutstanding) take_arrived(header.request_id, std::chrono::milliseconds(0));
    if (gone_) fail("the daemon has gone");
    try {
      if (outstanding_.size() >= kMostOutstanding ||
          !clearance::send(socket_, first, zmq::send_flags::sndmore | zmq::send_flags::dontwait))
        fail(still_there() ? "the daemon takes no more requests: its queue is full" : "the daemon has gone");
      clearance::send(socket_, second, zmq::send_flags::none);
    } catch (const zmq::error_t& error) {
      fail(error.what());
    }
    outstanding_.insert(header.request_id);
  }

  std::unique_ptr<Frame> receive(std::uint64_t request_id, Deadline deadline) override {
    for (;;) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
      take_arrived(request_id, std::clamp(left, std::chrono::milliseconds(0), kPollNap));
      if (const auto kept = kept_.find(request_id); kept != kept_.end()) {
        std::unique_ptr<Frame> frame = std::move(kept->second);
        kept_.erase(kept);
        return frame;
      }
      if (gone_) fail("the daemon has gone");
      if (left.count() <= 0) return nullptr;
      read_events();
    }
  }

  void forget(std::uint64_t request_id) override {
    outstanding_.erase(request_id);
    kept_.erase(request_id);
  }

  std::string url() const override { return endpoint_; }
  bool lost() const override { return gone_; }

  /// Requests an echo from the daemon's loop, since ZeroMQ's own thread answers ZeroMQ's heartbeats.
  std::uint64_t sign_of_life() override {
    const wire::FrameHeader echo = wire::make_header(wire::FrameType::kPing, kSignRequest, 0);
    zmq::message_t first(&echo, sizeof echo), second;
    try {
      if (clearance::send(socket_, first, zmq::send_flags::sndmore | zmq::send_flags::dontwait))
        clearance::send(socket_, second, zmq::send_flags::none);
    } catch (const zmq::error_t&) {  // without a sign of life
    }
    return arrived_ + 1;
  }

 private:
  [[noreturn]] void fail(const std::string& cause) const { throw ConnectionError(endpoint_ + ": " + cause); }

  void set_key(int option, const std::string& key) {
    if (zmq_setsockopt(socket_.handle(), option, key.data(), key.size()) != 0) fail(zmq_strerror(zmq_errno()));
  }

  std::string why_rejected() const {
    // The first failure, after which the connection is closed in any case.
    switch (failure_) {
      case ZMQ_EVENT_HANDSHAKE_FAILED_AUTH:
        return "the daemon rejects this client's key: it is not in the list of authorized keys";
      case ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL:
      case ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL:
      case ZMQ_EVENT_DISCONNECTED:
        if (endpoint_.rfind("ipc://", 0) == 0)  // which has no keys
          return "the daemon closed the connection before the handshake: it is ending, or has no descriptor for "
                 "another client";
        return with_keys_ ? "the daemon there has another key than server_key, or uses none"
                          : "the daemon there needs keys: give server_key=FILE&key=FILE in the url, or "
                            "CLEARANCE_SERVER_KEY and CLEARANCE_KEY in the environment";
      default:
        break;
    }
    if (endpoint_.rfind("ipc://", 0) == 0) {
      const std::string path = endpoint_.substr(6);
      struct stat info;
      if (stat(path.c_str(), &info)) return "no such socket: is clearanced running, with --zmq " + endpoint_ + "?";
      if (access(path.c_str(), W_OK)) return "permission denied: the daemon's user alone may connect";
    }
    return "no daemon listens there";
  }

  /// Receives all available messages up to the reply to `request_id`; waits up to `nap` for the first one.
  void take_arrived(std::uint64_t request_id, std::chrono::milliseconds nap) {
    if (kept_.count(request_id)) return;
    try {
      // One blocking call, since zmq::poll() on this socket and the monitor's needs half a dozen system calls.
      if (nap.count() > 0) socket_.set(zmq::sockopt::rcvtimeo, static_cast<int>(nap.count()));
      auto flags = nap.count() > 0 ? zmq::recv_flags::none : zmq::recv_flags::dontwait;
      zmq::message_t part;
      while (!kept_.count(request_id) && socket_.recv(part, std::exchange(flags, zmq::recv_flags::dontwait))) {
        parts_.clear();
        parts_.push_back(std::move(part));
        while (parts_.back().more()) {
          zmq::message_t next;
          clearance::receive(socket_, next, zmq::recv_flags::none);
          parts_.push_back(std::move(next));
        }
        accept_message();
      }
    } catch (const zmq::error_t& error) {
      if (error.num() != EINTR) fail(error.what());
    } catch (const wire::WireError& error) {
      fail(std::string("the daemon sent a malformed frame: ") + error.what());
    }
  }

  void accept_message() {
    wire::FrameHeader header;
    if (parts_.size() != 2 || parts_[0].size() != sizeof header)
      throw wire::WireError(wire::ErrorCode::kBadFrame, "a frame is a header of 64 bytes and a payload");
    std::memcpy(&header, parts_[0].data(), sizeof header);
    wire::check_header(header, parts_[1].size());
    ++arrived_;
    if (outstanding_.erase(header.request_id))
      kept_[header.request_id] = std::make_unique<ZmqFrame>(header, std::move(parts_[1]));
  }

  /// Returns false after the deadline.
  bool wait(std::vector<zmq::pollitem_t>& items, Deadline deadline) {
    const auto left = deadline - std::chrono::steady_clock::now();
    if (left <= left.zero()) return false;
    try {
      zmq::poll(items, std::chrono::ceil<std::chrono::milliseconds>(left));
    } catch (const zmq::error_t& error) {
      if (error.num() != EINTR) fail(error.what());
    }
    return true;
  }

  void read_events() {
    zmq::message_t event, address;
    while (monitor_.recv(event, zmq::recv_flags::dontwait)) {
      (void)monitor_.recv(address, zmq::recv_flags::none);
      std::uint16_t what = 0;
      std::memcpy(&what, event.data(), sizeof what);
      (what == ZMQ_EVENT_HANDSHAKE_SUCCEEDED ? connected_ : gone_) = true;
      if (!connected_ && failure_ == 0) failure_ = what;
    }
  }
  bool still_there() {
    read_events();
    return !gone_;
  }

  std::string endpoint_;
  bool with_keys_;
  int failure_ = 0;  ///< the event that ended the handshake
  zmq::context_t context_;
  zmq::socket_t socket_, monitor_;
  std::vector<zmq::pollitem_t> monitor_only_{{monitor_.handle(), 0, ZMQ_POLLIN, 0}};
  bool connected_ = false, gone_ = false;
  AlignedBytes room_;
  std::uint64_t room_bytes_ = 0;
  std::vector<zmq::message_t> parts_;
  std::uint64_t arrived_ = 0;  // frames
  std::unordered_set<std::uint64_t> outstanding_;
  std::unordered_map<std::uint64_t, std::unique_ptr<Frame>> kept_;
};

}  // namespace

std::unique_ptr<Channel> open_zmq_channel(const std::string& endpoint, const ChannelKeys& keys, Deadline deadline) {
  return std::make_unique<ZmqChannel>(endpoint, keys, deadline);
}

}  // namespace clearance
