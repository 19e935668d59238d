// ZeroMQ over TCP in the daemon, with the connections in a gateway process. Every message of the gateway is checked: it
// can claim to be a client with a key of the list, but no more.
#include <cstring>
#include <stdexcept>
#include <unordered_map>

#include "server/base/log_text.h"
#include "server/gateway/process.h"
#include "server/gateway/zmq_router.h"
#include "server/zmq/key_authenticator.h"
#include "server/zmq/tcp_listener.h"
#include "server/zmq/zmq_port.h"

namespace clearance {
namespace {

using gateway::Bytes;
using gateway::Kind;
using gateway::Message;

/// Replies that the gateway has not yet released.
constexpr std::size_t kMostNumbered = 65536;
/// Connections for idle clients and handshakes, in addition to clients with requests under way.
constexpr std::uint32_t kSpareConnections = 64;

gateway::ProcessOptions zmq_process_options(TcpListener listener, const Access& access) {
  gateway::ProcessOptions options;
  options.url = std::move(listener.url);
  options.what = "zmq";
  options.memory_bytes = access.gateway_bytes;
  options.connections = std::min(4 * access.max_clients + kSpareConnections, 60'000u);
  options.start = {Kind::kStart,
                   std::min(gateway::Process::message_bytes(access.gateway_bytes), wire::kMaxRequestBytes),
                   options.url,
                   access.keys ? access.keys->own().secret_key : "",
                   {}};
  options.listener = std::move(listener.socket);
  return options;
}

class ZmqGatewayPort final : public ZmqPort {
 public:
  ZmqGatewayPort(const std::string& endpoint, const Access& access) {
    if (access.keys) keys_.emplace(access.keys);
    TcpListener listener = listen_tcp(endpoint, access.keys != nullptr);
    url_ = listener.url;
    process_.emplace(zmq_process_options(std::move(listener), access));
  }

  std::string url() const override { return url_; }
  std::vector<int> descriptors() const override {
    return process_->descriptor() < 0 ? std::vector<int>() : std::vector<int>{process_->descriptor()};
  }
  bool has_work() override { return process_->has_more(); }
  std::uint64_t max_reply_bytes() const override { return process_->message_bytes(); }

  void begin_turn(RequestHandler& handler) override {
    handler_ = &handler;
    all_gone_ |= process_->turn(handler);
  }

  bool receive(ZmqArrival& arrival) override {
    arrival = {};
    if (std::exchange(all_gone_, false)) {
      for (const auto& [number, reply] : numbered_) *reply.unsent -= reply.bytes;
      numbered_.clear();
      unsent_ = 0;
      arrival.what = ZmqArrival::What::kAllGone;
      return true;
    }
    while (std::optional<Message> message = process_->receive())
      if (take(std::move(*message), arrival)) return true;
    return false;
  }

  SendResult send(const std::string& identity, AlignedBytes frame, std::uint64_t frame_bytes,
                  const UnsentBytes& unsent) override {
    Message message{Kind::kReply, 0, identity, {}, {}};
    message.extra.assign(reinterpret_cast<const char*>(frame.get()), sizeof(wire::FrameHeader));
    const std::uint64_t bytes = frame_bytes - sizeof(wire::FrameHeader);
    const std::shared_ptr<std::byte> whole(frame.release(), FreeDeleter());
    message.body = Bytes({whole, whole.get() + sizeof(wire::FrameHeader)}, bytes);
    if (bytes > kZmqCopyBytes) {
      // Replies that clients do not read must leave the gateway its memory.
      const bool fits = unsent_ == 0 || unsent_ + bytes <= 2 * process_->message_bytes();
      if (!fits || numbered_.size() >= kMostNumbered) return SendResult::kQueueFull;
      message.number = ++last_number_;
      numbered_.emplace(message.number, Numbered{unsent, bytes});
      *unsent += bytes;
      unsent_ += bytes;
    }
    process_->send(std::move(message));
    return SendResult::kSent;
  }

  void tick(RequestHandler& handler) override {
    if (keys_) keys_->tick();
    process_->tick(handler);
  }

 private:
  struct Numbered {
    UnsentBytes unsent;
    std::uint64_t bytes;
  };

  /// Whether the message is for the transport.
  bool take(Message message, ZmqArrival& arrival) {
    using What = ZmqArrival::What;
    arrival.identity = std::move(message.name);
    switch (message.kind) {
      case Kind::kFrame:
        if (message.extra.size() < sizeof arrival.header || message.body.bytes > wire::kMaxRequestBytes) break;
        std::memcpy(&arrival.header, message.extra.data(), sizeof arrival.header);
        arrival.key = message.extra.substr(sizeof arrival.header);
        arrival.payload = {std::move(message.body.begin), message.body.bytes};
        return is_client(arrival);
      case Kind::kNoFrame:
        arrival.what = What::kNoFrame;
        arrival.key = std::move(message.extra);
        arrival.parts = message.number >> 32;
        arrival.first_part_bytes = message.number & ~std::uint32_t{0};
        return is_client(arrival);
      case Kind::kGone:
        arrival.what = What::kClientGone;
        return true;
      case Kind::kNotDelivered:
        arrival.what = What::kNotDelivered;
        return true;
      case Kind::kReplyReleased:
        return release_reply(message.number), false;
      case Kind::kAuthenticate:
        return authenticate(arrival.identity, message.extra), false;
      case Kind::kHandshakeFailed:
        if (keys_)
          keys_->rejected(*handler_, "reason=\"the handshake failed: no keys, or another server's\" endpoint=" +
                                         log_text(arrival.identity));
        return false;
      default:
        break;
    }
    process_->lose("it sent something other than a ZeroMQ message");
    return false;
  }

  bool is_client(const ZmqArrival& arrival) {
    const bool is = !arrival.identity.empty() && (arrival.key.empty() || is_key(arrival.key)) &&
                    (keys_.has_value() == !arrival.key.empty());
    if (!is) process_->lose("it names an invalid client");
    return is;
  }

  void release_reply(std::uint64_t number) {
    const auto found = numbered_.find(number);
    if (found == numbered_.end()) return process_->lose("it releases a reply that it did not receive");
    *found->second.unsent -= found->second.bytes;
    unsent_ -= found->second.bytes;
    numbered_.erase(found);
  }

  void authenticate(const std::string& address, const std::string& key) {
    if (!keys_ || !is_key(key)) return process_->lose("it reports a client without a valid key");
    process_->send({Kind::kAuthenticated, keys_->admits(*handler_, address, key) ? 1u : 0u, {}, {}, {}});
  }

  std::string url_;
  std::optional<KeyAuthenticator> keys_;
  std::optional<gateway::Process> process_;
  RequestHandler* handler_ = nullptr;
  bool all_gone_ = false;
  std::unordered_map<std::uint64_t, Numbered> numbered_;
  std::uint64_t last_number_ = 0, unsent_ = 0;
};

}  // namespace

std::unique_ptr<ZmqPort> open_zmq_gateway(const std::string& endpoint, const Access& access) {
  return std::make_unique<ZmqGatewayPort>(endpoint, access);
}

}  // namespace clearance
