// ZeroMQ: a ROUTER that DEALER clients connect to, a frame as two message parts (header, payload).
#include <sys/stat.h>
#include <unistd.h>

#include <cassert>
#include <chrono>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <unordered_map>
#include <zmq.hpp>

#include "doorman.h"
#include "error_frame.h"
#include "places.h"
#include "transport.h"
#include "unix_socket.h"
#include "wire/aligned_buffer.h"
#include "wire/shm_os.h"
#include "wire/wire.h"
#include "zap_handler.h"
#include "zmq_calls.h"

namespace clearance {
namespace {

constexpr int kFramesPerPoll = 32;
constexpr int kBacklog = 100;  // connections that wait to be taken, as libzmq's own
/// Messages that may wait inside ZeroMQ, per client: requests not yet taken, replies not yet sent.
constexpr int kReceiveQueue = 64;
constexpr int kSendQueue = 128;
/// Bytes of replies that may wait for one client that does not read them; one reply may always be sent.
constexpr std::uint64_t kMaxUnsentBytes = std::uint64_t{256} << 20;
/// Replies up to this size are copied into the message, larger ones handed over.
constexpr std::uint64_t kCopyBytes = 1024;
constexpr auto kLookAtKeysEvery = std::chrono::seconds(1);
constexpr auto kForgetPeerAfter = std::chrono::minutes(1);

/// A client as ROUTER knows it.
struct Peer {
  std::string identity;
  std::optional<ucred> who;  ///< over ipc://
  std::string key;           ///< with which it came in; empty: without
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
  ZmqSink(ZmqTransport& transport, PeerPtr peer, Rights rights)
      : transport_(transport), peer_(std::move(peer)), rights_(rights) {}
  std::byte* reserve(std::uint64_t frame_bytes) override {
    if (frame_bytes > wire::kMaxFrameBytes) return nullptr;
    frame_ = aligned_bytes(frame_bytes);
    return frame_.get();
  }
  void publish(std::uint64_t frame_bytes) override;
  bool alive() const override { return !peer_->gone; }
  std::uint64_t client() const override { return peer_->id; }
  std::uint64_t unsent_bytes() const override { return peer_->unsent_bytes->load(std::memory_order_relaxed); }
  Rights rights() const override { return rights_; }

 private:
  ZmqTransport& transport_;
  PeerPtr peer_;
  Rights rights_;
  AlignedBytes frame_;
};

/// Refuses an address that is none, or that strangers could reach.
void check_tcp(const std::string& endpoint, bool with_keys) {
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
  if (with_keys || host == "localhost" || host == "[::1]" || host == "lo" || host.rfind("127.", 0) == 0) return;
  throw std::runtime_error(
      endpoint +
      ": anyone who reaches this address could move bodies; give --keys DIR (clearance keygen --help), "
      "or use ipc:// or tcp://127.0.0.1:PORT");
}

/// The process at the other end of a Unix socket, as libzmq puts it into the properties of a message
/// ("PATH:UID:GID:PID").
std::optional<ucred> sender_of(const zmq::message_t& message) {
  const char* address = zmq_msg_gets(const_cast<zmq_msg_t*>(message.handle()), "Peer-Address");
  if (!address) return std::nullopt;
  ucred who{};
  const std::string text(address);
  std::size_t colon = text.size();
  for (int i = 0; i < 3 && colon != std::string::npos; ++i)
    colon = colon ? text.rfind(':', colon - 1) : std::string::npos;
  if (colon == std::string::npos || std::sscanf(text.c_str() + colon, ":%u:%u:%d", &who.uid, &who.gid, &who.pid) != 3)
    return std::nullopt;
  return who;
}

/// A Unix socket of this user's alone that listens at `path`. Throws std::runtime_error.
shm::UniqueFd listen_at(const std::string& path, const std::string& endpoint) {
  sockaddr_un address;  // whose length clear_stale_socket() has looked at
  shm::socket_address(path.c_str(), address);
  shm::UniqueFd listener(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const mode_t mask = umask(077);
  const bool bound =
      listener && ::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  umask(mask);
  if (bound) refuse_descriptors(listener.get());
  if (!bound || ::listen(listener.get(), kBacklog) != 0)
    throw std::runtime_error(endpoint + ": cannot listen there: " + std::strerror(errno));
  return listener;
}

class ZmqTransport final : public Transport {
 public:
  ZmqTransport(const std::string& endpoint, const Access& access)
      : access_(access), socket_(context_, zmq::socket_type::router) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::router_mandatory, 1);
    socket_.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(wire::kMaxRequestBytes));
    socket_.set(zmq::sockopt::rcvhwm, kReceiveQueue);
    socket_.set(zmq::sockopt::sndhwm, kSendQueue);
    if (endpoint.rfind("ipc://", 0) == 0) {
      bind_ipc(endpoint);
    } else if (endpoint.rfind("tcp://", 0) == 0) {
      is_tcp_ = true;
      check_tcp(endpoint, access.keys != nullptr);
      if (access.keys) {
        door_.emplace(context_, access.keys);
        door_->guard(socket_);
      }
      bind(endpoint);
    } else {
      throw std::runtime_error(endpoint + ": expected ipc:///path or tcp://127.0.0.1:PORT");
    }
    url_ = socket_.get(zmq::sockopt::last_endpoint);
  }

  ~ZmqTransport() override {
    door_.reset();
    socket_.close();
    context_.close();  // its I/O thread removes the socket file; in case it does not:
    file_.remove();
  }

  std::string url() const override { return url_; }
  std::vector<int> descriptors() const override {
    std::vector<int> all{socket_.get(zmq::sockopt::fd)};
    if (door_)
      for (const int fd : door_->descriptors()) all.push_back(fd);
    return all;
  }

  bool polls_by_system_call() const override { return true; }

  int poll(Inbox& inbox) override {
    dropped_ = &inbox.counter("zmq.replies_dropped");
    if (door_) door_->serve(inbox);
    int frames = 0;
    zmq::message_t part;
    while (frames < kFramesPerPoll && receive(socket_, part, zmq::recv_flags::dontwait)) {
      int parts = 0;
      zmq::message_t identity = std::move(part), head, payload;
      for (bool more = identity.more(); more;) {
        receive(socket_, part, zmq::recv_flags::none);
        more = part.more();
        if (++parts == 1) head = std::move(part);
        if (parts == 2) payload = std::move(part);
      }
      // Who sent it is known of the parts that came over the wire; the identity is libzmq's own.
      std::string why;
      PeerPtr peer = peer_of(identity, head, why);
      if (!peer) {
        refuse_one_more(inbox, identity, head, why);
      } else {
        hand_in(inbox, std::move(peer), rights_of(head), parts, head, payload);
      }
      ++frames;
    }
    return frames;
  }

  /// The descriptor only tells of changes: what had arrived before must be asked for.
  bool prepare_sleep() override { return has_input(socket_) || (door_ && door_->has_work()); }

  void tick(Inbox& inbox) override {
    const auto now = std::chrono::steady_clock::now();
    if (door_ && now >= next_look_at_keys_) {
      next_look_at_keys_ = now + kLookAtKeysEvery;
      door_->refresh();
    }
    for (auto peer = peers_.begin(); peer != peers_.end();) {
      const bool idle = peer->second.use_count() == 1 && now - peer->second->last_seen > kForgetPeerAfter;
      peer = idle ? peers_.erase(peer) : std::next(peer);
    }
    inbox.counter("zmq.clients") = peers_.size();
  }

  void send(Peer& peer, AlignedBytes frame, std::uint64_t frame_bytes) {
    assert(frame && frame_bytes >= sizeof(wire::FrameHeader));
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
      if (!clearance::send(socket_, identity, zmq::send_flags::sndmore | zmq::send_flags::dontwait)) {
        ++*dropped_;
        return;
      }
      clearance::send(socket_, head, zmq::send_flags::sndmore);
      clearance::send(socket_, payload, zmq::send_flags::none);
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
    shm::UniqueFd listener = listen_at(path, endpoint);
    file_ = SocketFile(path);
    set_socket_mode(path, endpoint, access_);
    socket_.set(zmq::sockopt::use_fd, listener.get());
    bind(endpoint);
    listener.release();  // libzmq closes it
  }

  /// The client that a message is from. Null, with `why`: it is a new one, and as many as may be have requests under
  /// way.
  PeerPtr peer_of(const zmq::message_t& identity, const zmq::message_t& sent, std::string& why) {
    const std::optional<ucred> who = is_tcp_ ? std::nullopt : sender_of(sent);
    if (!peers_.contains(identity.to_string()) && !has_place(who, class_of(rights_of(sent)), why)) return nullptr;
    PeerPtr& peer = peers_[identity.to_string()];
    std::string key = door_ ? ZapHandler::key_of(sent) : std::string();
    if (peer && peer->key != key) {  // a name that another has chosen before, and given up
      peer->gone = true;
      peer = nullptr;
    }
    if (!peer) {
      peer = std::make_shared<Peer>();
      peer->identity = identity.to_string();
      peer->who = who;
      peer->key = std::move(key);
    }
    peer->last_seen = std::chrono::steady_clock::now();
    return peer;
  }

  /// Whether a new client has a place beside those that have requests under way.
  bool has_place(const std::optional<ucred>& who, ServiceClass service, std::string& why) {
    const std::uint64_t most = access_.max_clients;
    if (peers_.size() < most - most / 2) return true;
    Places places(most);
    std::uint64_t busy = 0;
    for (const auto& [identity, peer] : peers_) {
      if (peer.use_count() == 1) continue;
      ++busy;
      if (peer->who) places.take(*peer->who);
    }
    const bool is_kept = service != ServiceClass::kControl && access_.has_control();
    if (busy >= most - (is_kept ? kept_for_control(most) : 0))
      why = "requests of " + std::to_string(busy) + " ZeroMQ clients are under way already";
    else if (who)
      why = places.why_not(*who, "ZeroMQ clients with requests under way", service);
    return why.empty() && (peers_.size() < most || forget_one());
  }

  /// Forgets the client without requests that was silent for longest; it is a new one if it comes again. False: there
  /// is none.
  bool forget_one() {
    auto oldest = peers_.end();
    for (auto peer = peers_.begin(); peer != peers_.end(); ++peer)
      if (peer->second.use_count() == 1 &&
          (oldest == peers_.end() || peer->second->last_seen < oldest->second->last_seen))
        oldest = peer;
    if (oldest == peers_.end()) return false;
    peers_.erase(oldest);
    return true;
  }

  void refuse_one_more(Inbox& inbox, const zmq::message_t& identity, const zmq::message_t& head,
                       const std::string& why) {
    ++inbox.counter("zmq.over_quota");
    ++inbox.counter("frames");
    ++inbox.counter("errors");
    ++inbox.counter("errors.busy");
    wire::FrameHeader header;
    if (head.size() == sizeof header) std::memcpy(&header, head.data(), sizeof header);
    auto stranger = std::make_shared<Peer>();
    stranger->identity = identity.to_string();
    ZmqSink sink(*this, std::move(stranger), 0);
    send_error(sink, header, inbox.engine().scene_revision(), wire::ErrorCode::kBusy,
               why + "; ask again (--max-clients)");
  }

  /// What the sender of a message may do.
  Rights rights_of(const zmq::message_t& message) const {
    if (door_) return door_->rights_of(message);
    if (is_tcp_) return kStrangersRights;
    if (!access_.group) return *rights_of_user(geteuid(), false, access_);  // the socket is this user's alone
    const std::optional<ucred> who = sender_of(message);
    return who ? *rights_of_user(who->uid, true, access_) : access_.group_rights;
  }

  void hand_in(Inbox& inbox, PeerPtr peer, Rights rights, int parts, const zmq::message_t& head,
               zmq::message_t& payload) {
    wire::FrameHeader header;
    auto sink = std::make_unique<ZmqSink>(*this, std::move(peer), rights);
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
    if (payload.size() <= kLargePayload)
      return inbox.on_frame(header, {payload.data<std::byte>(), payload.size()}, std::move(sink));
    const auto own = std::make_shared<zmq::message_t>(std::move(payload));
    const OwnPayload fetched{{own, own->data<std::byte>()}, own->size()};
    inbox.on_large_frame(header, fetched.bytes, [fetched] { return fetched; }, std::move(sink));
  }

  std::string url_;
  SocketFile file_;
  Access access_;
  bool is_tcp_ = false;
  zmq::context_t context_;
  std::optional<ZapHandler> door_;  // of TCP with keys
  std::chrono::steady_clock::time_point next_look_at_keys_{};
  zmq::socket_t socket_;
  std::unordered_map<std::string, PeerPtr> peers_;
  std::uint64_t* dropped_ = nullptr;  // set by poll(), before any sink exists
};

void ZmqSink::publish(std::uint64_t frame_bytes) {
  transport_.send(*peer_, std::move(frame_), frame_bytes);
}

}  // namespace

std::unique_ptr<Transport> make_zmq_transport(const std::string& endpoint, const Access& access) {
  return std::make_unique<ZmqTransport>(endpoint, access);
}

}  // namespace clearance
