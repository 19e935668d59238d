// ZeroMQ: a ROUTER that DEALER clients connect to, a frame as two message parts (header, payload).
#include <sys/stat.h>

#include <chrono>
#include <cstring>
#include <stdexcept>
#include <unordered_map>
#include <zmq.hpp>

#include "client/aligned_buffer.h"
#include "client/wire.h"
#include "error_frame.h"
#include "transport.h"
#include "unix_socket.h"

namespace clearance {
namespace {

constexpr int kFramesPerPoll = 32;
/// Messages that may wait inside ZeroMQ, per client: requests not yet taken, replies not yet sent.
constexpr int kReceiveQueue = 64;
constexpr int kSendQueue = 128;
/// Bytes of replies that may wait for one client that does not read them; one reply may always be sent.
constexpr std::uint64_t kMaxUnsentBytes = std::uint64_t{256} << 20;
/// Replies up to this size are copied into the message, larger ones handed over.
constexpr std::uint64_t kCopyBytes = 1024;
constexpr auto kForgetPeerAfter = std::chrono::minutes(1);

/// A client as ROUTER knows it.
struct Peer {
  std::string identity;
  std::uint64_t id = next_client_id();
  bool gone = false;
  std::chrono::steady_clock::time_point last_seen;
  /// Of replies handed to ZeroMQ and not yet given back by its I/O thread.
  std::shared_ptr<std::atomic<std::uint64_t>> unsent_bytes = std::make_shared<std::atomic<std::uint64_t>>(0);
};
using PeerPtr = std::shared_ptr<Peer>;

/// What ZeroMQ's I/O thread calls once a reply has gone out or was dropped with its connection.
struct HandedOver {
  std::byte* frame;
  std::uint64_t bytes;
  std::shared_ptr<std::atomic<std::uint64_t>> unsent_bytes;

  static void give_back(void*, void* hint) {
    const std::unique_ptr<HandedOver> self(static_cast<HandedOver*>(hint));
    std::free(self->frame);
    *self->unsent_bytes -= self->bytes;
  }
};

class ZmqTransport;

class ZmqSink final : public ReplySink {
 public:
  ZmqSink(ZmqTransport& transport, PeerPtr peer) : transport_(transport), peer_(std::move(peer)) {}
  std::byte* reserve(std::uint64_t frame_bytes) override {
    if (frame_bytes > wire::kMaxFrameBytes) return nullptr;
    frame_ = aligned_bytes(frame_bytes);
    return frame_.get();
  }
  void publish(std::uint64_t frame_bytes) override;
  bool alive() const override { return !peer_->gone; }
  std::uint64_t client() const override { return peer_->id; }

 private:
  ZmqTransport& transport_;
  PeerPtr peer_;
  AlignedBytes frame_;
};

/// Refuses an address that strangers could reach.
void check_tcp(const std::string& endpoint) {
  std::string host = endpoint.substr(6);
  const std::size_t colon = host.rfind(':');
  if (colon == std::string::npos)
    throw std::runtime_error(endpoint + ": the port is missing, as in tcp://127.0.0.1:5555");
  // ZeroMQ itself would take 99999 for 34463.
  const std::string port = host.substr(colon + 1);
  const bool digits = !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos;
  if (port != "*" && !(digits && std::stoi(port) >= 1 && std::stoi(port) <= 65535))
    throw std::runtime_error(endpoint + ": the port must be 1 to 65535, or * for a free one; got \"" + port + "\"");
  host.resize(colon);
  if (host == "localhost" || host == "[::1]" || host == "lo" || host.rfind("127.", 0) == 0) return;
  throw std::runtime_error(
      endpoint +
      ": anyone who reaches this address could move bodies, and keys (CURVE) are not supported yet; "
      "use ipc://, or tcp://127.0.0.1:PORT and a tunnel");
}

class ZmqTransport final : public Transport {
 public:
  explicit ZmqTransport(const std::string& endpoint) : socket_(context_, zmq::socket_type::router) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::router_mandatory, 1);
    socket_.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(wire::kMaxRequestBytes));
    socket_.set(zmq::sockopt::rcvhwm, kReceiveQueue);
    socket_.set(zmq::sockopt::sndhwm, kSendQueue);
    if (endpoint.rfind("ipc://", 0) == 0) {
      bind_ipc(endpoint);
    } else if (endpoint.rfind("tcp://", 0) == 0) {
      check_tcp(endpoint);
      bind(endpoint);
    } else {
      throw std::runtime_error(endpoint + ": expected ipc:///path or tcp://127.0.0.1:PORT");
    }
    url_ = socket_.get(zmq::sockopt::last_endpoint);
  }

  ~ZmqTransport() override {
    socket_.close();
    context_.close();  // its I/O thread removes the socket file; in case it does not:
    file_.remove();
  }

  std::string url() const override { return url_; }
  std::vector<int> descriptors() const override { return {socket_.get(zmq::sockopt::fd)}; }

  bool polls_by_system_call() const override { return true; }

  int poll(Inbox& inbox) override {
    dropped_ = &inbox.counter("zmq.replies_dropped");
    int frames = 0;
    zmq::message_t part;
    while (frames < kFramesPerPoll && socket_.recv(part, zmq::recv_flags::dontwait)) {
      PeerPtr peer = peer_of(part);
      int parts = 0;
      zmq::message_t head, payload;
      for (bool more = part.more(); more;) {
        (void)socket_.recv(part, zmq::recv_flags::none);
        more = part.more();
        if (++parts == 1) head = std::move(part);
        if (parts == 2) payload = std::move(part);
      }
      hand_in(inbox, std::move(peer), parts, head, payload);
      ++frames;
    }
    return frames;
  }

  /// The descriptor only tells of changes: what had arrived before must be asked for.
  bool prepare_sleep() override { return socket_.get(zmq::sockopt::events) & ZMQ_POLLIN; }

  void tick(Inbox& inbox) override {
    const auto now = std::chrono::steady_clock::now();
    for (auto peer = peers_.begin(); peer != peers_.end();) {
      const bool idle = peer->second.use_count() == 1 && now - peer->second->last_seen > kForgetPeerAfter;
      peer = idle ? peers_.erase(peer) : std::next(peer);
    }
    inbox.counter("zmq.clients") = peers_.size();
  }

  void send(Peer& peer, AlignedBytes frame, std::uint64_t frame_bytes) {
    const std::uint64_t payload_bytes = frame_bytes - sizeof(wire::FrameHeader);
    const std::uint64_t waiting = peer.unsent_bytes->load();
    if (waiting && waiting + payload_bytes > kMaxUnsentBytes) {
      ++*dropped_;
      return;
    }
    zmq::message_t identity(peer.identity.data(), peer.identity.size());
    zmq::message_t head(frame.get(), sizeof(wire::FrameHeader)), payload;
    std::byte* begin = frame.get() + sizeof(wire::FrameHeader);
    if (payload_bytes > kCopyBytes) {
      auto* hint = new HandedOver{frame.release(), payload_bytes, peer.unsent_bytes};
      *peer.unsent_bytes += payload_bytes;
      payload.rebuild(begin, payload_bytes, &HandedOver::give_back, hint);
    } else {
      payload.rebuild(begin, payload_bytes);
    }
    // With ROUTER_MANDATORY the first part tells whether the client is there (EHOSTUNREACH) and its queue has room
    // (EAGAIN).
    try {
      if (!socket_.send(identity, zmq::send_flags::sndmore | zmq::send_flags::dontwait)) {
        ++*dropped_;
        return;
      }
      (void)socket_.send(head, zmq::send_flags::sndmore);
      (void)socket_.send(payload, zmq::send_flags::none);
    } catch (const zmq::error_t& error) {
      if (error.num() != EHOSTUNREACH) throw;
      ++*dropped_;
      peer.gone = true;
      peers_.erase(peer.identity);
    }
  }

 private:
  void bind(const std::string& endpoint) {
    try {
      socket_.bind(endpoint);
    } catch (const zmq::error_t& error) {
      throw std::runtime_error(endpoint + ": cannot listen there: " + error.what());
    }
  }

  void bind_ipc(const std::string& endpoint) {
    const std::string path = endpoint.substr(6);
    if (path.empty() || path[0] != '/')
      throw std::runtime_error(endpoint +
                               ": the path of the socket must be absolute, as in ipc:///run/user/1000/clearance.ipc");
    // ZeroMQ takes over whatever is at the path, a living daemon's socket too: looked at first.
    const FolderLock lock(path);
    clear_stale_socket(path, endpoint);
    const mode_t mask = umask(077);
    try {
      bind(endpoint);
    } catch (...) {
      umask(mask);
      throw;
    }
    umask(mask);
    file_ = SocketFile(path);
  }

  PeerPtr peer_of(const zmq::message_t& identity) {
    PeerPtr& peer = peers_[identity.to_string()];
    if (!peer) {
      peer = std::make_shared<Peer>();
      peer->identity = identity.to_string();
    }
    peer->last_seen = std::chrono::steady_clock::now();
    return peer;
  }

  void hand_in(Inbox& inbox, PeerPtr peer, int parts, const zmq::message_t& head, const zmq::message_t& payload) {
    wire::FrameHeader header;
    auto sink = std::make_unique<ZmqSink>(*this, std::move(peer));
    if (parts != 2 || head.size() != sizeof header) {
      // No header, no request id: the answer carries 0.
      ++inbox.counter("frames");
      ++inbox.counter("errors");
      ++inbox.counter("errors.bad_frame");
      const std::string got =
          std::to_string(parts) + (parts ? " parts, the first of " + std::to_string(head.size()) + " bytes" : " parts");
      send_error(*sink, {}, inbox.engine().scene_revision(), wire::ErrorCode::kBadFrame,
                 "frame: ZeroMQ carries it in two parts, a header of 64 bytes and a payload; got " + got);
      return;
    }
    std::memcpy(&header, head.data(), sizeof header);
    inbox.on_frame(header, {payload.data<std::byte>(), payload.size()}, std::move(sink));
  }

  std::string url_;
  SocketFile file_;
  zmq::context_t context_;
  zmq::socket_t socket_;
  std::unordered_map<std::string, PeerPtr> peers_;
  std::uint64_t* dropped_ = nullptr;  // set by poll(), before any sink exists
};

void ZmqSink::publish(std::uint64_t frame_bytes) {
  transport_.send(*peer_, std::move(frame_), frame_bytes);
}

}  // namespace

std::unique_ptr<Transport> make_zmq_transport(const std::string& endpoint) {
  return std::make_unique<ZmqTransport>(endpoint);
}

}  // namespace clearance
