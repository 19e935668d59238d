// ZeroMQ: a ROUTER that DEALER clients connect to, a frame as two message parts (header, payload).
#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cassert>
#include <chrono>
#include <stdexcept>
#include <unordered_map>
#include <vector>

#include "server/access/authorized_keys.h"
#include "server/limits/places.h"
#include "server/requests/error_frame.h"
#include "server/requests/transport.h"
#include "server/zmq/zmq_port.h"
#include "wire/shm_os.h"
#include "wire/wire.h"

namespace clearance {
namespace {

constexpr int kFramesPerPoll = 32;
/// Bytes of replies that may wait for one client that does not read. One reply may always be sent.
constexpr std::uint64_t kMaxUnsentBytes = std::uint64_t{256} << 20;
constexpr auto kForgetPeerAfter = std::chrono::minutes(1);

/// A client of the ROUTER socket.
struct Peer {
  std::string identity;
  std::optional<ucred> who;  ///< over ipc://
  std::string key;           ///< of the client, or empty
  std::uint64_t id = next_client_id();
  bool gone = false;
  std::chrono::steady_clock::time_point last_seen;
  UnsentBytes unsent_bytes = std::make_shared<std::atomic<std::uint64_t>>(0);
};
using PeerPtr = std::shared_ptr<Peer>;

class ZmqTransport;

class ZmqSink final : public ReplySink {
 public:
  ZmqSink(ZmqTransport& transport, PeerPtr peer, Rights rights)
      : transport_(transport), peer_(std::move(peer)), rights_(rights) {}
  std::byte* reserve(std::uint64_t frame_bytes) override;
  void publish(std::uint64_t frame_bytes) override;
  bool alive() const override { return !peer_->gone; }
  std::uint64_t client() const override { return peer_->id; }
  std::function<bool()> watch() const override;
  std::uint64_t unsent_bytes() const override { return peer_->unsent_bytes->load(std::memory_order_relaxed); }
  Rights rights() const override { return rights_; }

 private:
  ZmqTransport& transport_;
  PeerPtr peer_;
  Rights rights_;
  AlignedBytes frame_;
};

class ZmqTransport final : public Transport {
 public:
  ZmqTransport(const std::string& endpoint, const Access& access) : access_(access) {
    if (endpoint.rfind("ipc://", 0) == 0) {
      port_ = open_zmq_socket(endpoint, access);
    } else if (endpoint.rfind("tcp://", 0) == 0) {
      is_tcp_ = true;
      port_ = open_zmq_gateway(endpoint, access);
    } else {
      throw std::runtime_error(endpoint + ": expected ipc:///path or tcp://127.0.0.1:PORT");
    }
  }

  std::string url() const override { return port_->url(); }
  std::vector<int> descriptors() const override { return port_->descriptors(); }

  bool polls_by_system_call() const override { return true; }

  int poll(RequestHandler& handler) override {
    dropped_ = &handler.counter("zmq.replies_dropped");
    port_->begin_turn(handler);
    int frames = 0;
    for (ZmqArrival arrival; frames < kFramesPerPoll && port_->receive(arrival); ++frames) take(handler, arrival);
    return frames;
  }

  bool prepare_sleep() override { return port_->has_work(); }

  void tick(RequestHandler& handler) override {
    port_->tick(handler);
    const auto now = std::chrono::steady_clock::now();
    for (auto peer = peers_.begin(); peer != peers_.end();) {
      const bool idle = peer->second.use_count() == 1 && now - peer->second->last_seen > kForgetPeerAfter;
      peer = idle ? peers_.erase(peer) : std::next(peer);
    }
    handler.counter("zmq.clients") = peers_.size();
  }

  void send(Peer& peer, AlignedBytes frame, std::uint64_t frame_bytes) {
    assert(frame && frame_bytes >= sizeof(wire::FrameHeader));
    const std::uint64_t waiting = peer.unsent_bytes->load();
    // Another client may have the name of one that is gone.
    if (peer.gone || (waiting && waiting + frame_bytes > kMaxUnsentBytes)) {
      ++*dropped_;
      return;
    }
    const ZmqPort::SendResult sent = port_->send(peer.identity, std::move(frame), frame_bytes, peer.unsent_bytes);
    if (sent != ZmqPort::SendResult::kSent) ++*dropped_;
    if (sent == ZmqPort::SendResult::kNoPeer) forget(peer.identity);
  }

  std::uint64_t max_reply_bytes() const { return port_->max_reply_bytes(); }

 private:
  void take(RequestHandler& handler, ZmqArrival& arrival) {
    switch (arrival.what) {
      case ZmqArrival::What::kAllGone:
        for (const auto& [identity, peer] : peers_) peer->gone = true;
        peers_.clear();
        return;
      case ZmqArrival::What::kClientGone:
        ++*dropped_;
        return forget(arrival.identity);
      case ZmqArrival::What::kNotDelivered:
        ++*dropped_;
        return;
      default:
        break;
    }
    std::string why;
    PeerPtr peer = peer_of(arrival, why);
    if (!peer) return reject_one_more(handler, arrival, why);
    hand_in(handler, std::move(peer), arrival);
  }

  void forget(const std::string& identity) {
    const auto peer = peers_.find(identity);
    if (peer == peers_.end()) return;
    peer->second->gone = true;
    peers_.erase(peer);
  }

  /// Client of a message. Returns null and sets `why` for a new client beyond the limit.
  PeerPtr peer_of(const ZmqArrival& from, std::string& why) {
    if (!peers_.contains(from.identity) && !has_place(from.who, class_of(rights_of(from)), why)) return nullptr;
    PeerPtr& peer = peers_[from.identity];
    if (peer && peer->key != from.key) {  // a name that another client had before
      peer->gone = true;
      peer = nullptr;
    }
    if (!peer) {
      peer = std::make_shared<Peer>();
      peer->identity = from.identity;
      peer->who = from.who;
      peer->key = from.key;
    }
    peer->last_seen = std::chrono::steady_clock::now();
    return peer;
  }

  /// Whether a new client may join those with requests under way.
  bool has_place(const std::optional<ucred>& who, ServiceClass service, std::string& why) {
    const std::uint64_t most = access_.max_clients;
    if (peers_.size() < most - most / 2) return true;
    Places places(most);
    std::vector<Places::Share> taken;
    std::uint64_t busy = 0;
    for (const auto& [identity, peer] : peers_) {
      if (peer.use_count() == 1) continue;
      ++busy;
      if (peer->who) taken.push_back(places.take(*peer->who));
    }
    const bool is_kept = service != ServiceClass::kControl && access_.has_control();
    if (busy >= most - (is_kept ? kept_for_control(most) : 0))
      why = "requests of " + std::to_string(busy) + " ZeroMQ clients are under way already";
    else if (who)
      why = places.why_not(*who, "ZeroMQ clients with requests under way", service);
    return why.empty() && (peers_.size() < most || forget_one());
  }

  /// Forgets the client without requests that was idle for longest. It counts as new when it comes again. Returns false
  /// if there is none.
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

  void reject_one_more(RequestHandler& handler, const ZmqArrival& from, const std::string& why) {
    ++handler.counter("zmq.over_quota");
    ++handler.counter("frames");
    ++handler.counter("errors");
    ++handler.counter("errors.busy");
    auto peer = std::make_shared<Peer>();
    peer->identity = from.identity;
    ZmqSink sink(*this, std::move(peer), 0);
    send_error(sink, from.header, handler.engine().scene_revision(), wire::ErrorCode::kBusy,
               why + "; retry later (limit max-clients)");
  }

  /// Rights of a message's sender.
  Rights rights_of(const ZmqArrival& from) const {
    if (access_.keys && is_tcp_) return access_.keys->rights_of(from.key);
    if (is_tcp_) return kStrangersRights;
    if (!access_.group) return *rights_of_user(geteuid(), false, access_);  // the socket is for this user only
    return from.who ? *rights_of_user(from.who->uid, true, access_) : access_.group_rights;
  }

  void hand_in(RequestHandler& handler, PeerPtr peer, ZmqArrival& from) {
    auto sink = std::make_unique<ZmqSink>(*this, std::move(peer), rights_of(from));
    if (from.what == ZmqArrival::What::kNoFrame) {
      // Without a header there is no request id, and the reply has 0.
      ++handler.counter("frames");
      ++handler.counter("errors");
      ++handler.counter("errors.bad_frame");
      const std::string got =
          std::to_string(from.parts) +
          (from.parts ? " parts, the first of " + std::to_string(from.first_part_bytes) + " bytes" : " parts");
      send_error(*sink, {}, handler.engine().scene_revision(), wire::ErrorCode::kBadFrame,
                 "frame: ZeroMQ carries it in two parts, a header of 64 bytes and a payload; got " + got);
      return;
    }
    if (from.payload.bytes <= kLargePayload) return handler.on_frame(from.header, from.payload.span(), std::move(sink));
    const std::uint64_t bytes = from.payload.bytes;
    handler.on_large_frame(
        from.header, bytes, [payload = std::move(from.payload)] { return payload; }, std::move(sink));
  }

  Access access_;
  bool is_tcp_ = false;
  std::unordered_map<std::string, PeerPtr> peers_;
  std::uint64_t* dropped_ = nullptr;  // set by poll(), before any sink is made
  std::unique_ptr<ZmqPort> port_;
};

/// ROUTER does not report that a client has gone, but its process can be watched.
std::function<bool()> ZmqSink::watch() const {
  if (!peer_->who || peer_->who->pid <= 0) return nullptr;
  const auto process = std::make_shared<shm::UniqueFd>(static_cast<int>(::syscall(SYS_pidfd_open, peer_->who->pid, 0)));
  if (!*process) return nullptr;
  return [peer = peer_, process] {
    pollfd ended{process->get(), POLLIN, 0};
    return !peer->gone && ::poll(&ended, 1, 0) == 0;
  };
}

std::byte* ZmqSink::reserve(std::uint64_t frame_bytes) {
  if (frame_bytes > transport_.max_reply_bytes()) return nullptr;
  frame_ = aligned_bytes(frame_bytes);
  return frame_.get();
}

void ZmqSink::publish(std::uint64_t frame_bytes) {
  transport_.send(*peer_, std::move(frame_), frame_bytes);
}

}  // namespace

std::unique_ptr<Transport> make_zmq_transport(const std::string& endpoint, const Access& access) {
  return std::make_unique<ZmqTransport>(endpoint, access);
}

}  // namespace clearance
