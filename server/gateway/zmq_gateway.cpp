#include "server/gateway/zmq_gateway.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <zmq.hpp>

#include "server/gateway/confine.h"
#include "server/gateway/zap_handler.h"
#include "server/gateway/zmq_router.h"
#include "server/gateway/zmtp_gate.h"
#include "wire/protocol.h"
#include "wire/zmq_calls.h"

namespace clearance::gateway {
namespace {

constexpr int kFramesPerTurn = 32;
/// A handshake takes two round trips.
constexpr int kHandshakeMs = 3000;
/// A frame has two parts. Further parts are discarded, which takes time: a message of so many ends this process, as a
/// restart is faster.
constexpr int kMostParts = 65536;

/// Numbers of replies that libzmq has released, from its I/O thread.
class ReleasedReplies {
 public:
  ReleasedReplies() : wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (!wake_) throw std::runtime_error(std::string("eventfd: ") + std::strerror(errno));
  }
  int descriptor() const { return wake_.get(); }
  void add(std::uint64_t number) {
    const std::lock_guard lock(mutex_);
    numbers_.push_back(number);
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(wake_.get(), &one, sizeof one);
  }
  std::vector<std::uint64_t> take() {
    std::uint64_t count;
    [[maybe_unused]] const auto got = ::read(wake_.get(), &count, sizeof count);
    const std::lock_guard lock(mutex_);
    return std::exchange(numbers_, {});
  }

 private:
  shm::UniqueFd wake_;
  std::mutex mutex_;
  std::vector<std::uint64_t> numbers_;
};

/// A reply's payload, kept as long as libzmq needs it.
struct Held {
  Bytes bytes;
  std::uint64_t number;
  ReleasedReplies& released;

  static void give_back(void*, void* hint) {
    const std::unique_ptr<Held> self(static_cast<Held*>(hint));
    self->released.add(self->number);
  }
};

class ZmqGateway {
 public:
  ZmqGateway(Link& link, const Message& start)
      : link_(link), most_waiting_bytes_(start.number), router_(context_, zmq::socket_type::router) {
    set_router_options(router_, start.number);
    router_.set(zmq::sockopt::handshake_ivl, kHandshakeMs);
    if (!start.extra.empty()) {
      guard_connections();
      zap_.emplace(context_, ZapHandler::Callbacks{[this](const std::string& address, const std::string& key) {
                                                     send(Kind::kAuthenticate, address, key);
                                                   },
                                                   [this](const std::string& endpoint) {
                                                     if (may_take_more()) send(Kind::kHandshakeFailed, endpoint);
                                                   }});
      zap_->guard(router_, start.extra);
    }
    const std::string unfiltered = confine_to_connections();
    // From here on data of unauthenticated peers is read.
    router_.set(zmq::sockopt::use_fd, kListenerFd);
    router_.bind(start.name);
    link_.send({Kind::kReady, 0, {}, {}, Bytes(unfiltered)});
  }

  [[noreturn]] void run() {
    for (;;) {
      wait();
      link_.turn();
      while (std::optional<Message> message = link_.receive()) handle(std::move(*message));
      for (const std::uint64_t number : released_.take()) send(Kind::kReplyReleased, {}, {}, number);
      if (zap_) zap_->serve();
      for (int i = 0; i < kFramesPerTurn && may_take_more() && take_frame(); ++i) {
      }
    }
  }

 private:
  bool may_take_more() const { return link_.waiting_bytes() <= most_waiting_bytes_; }

  void send(Kind kind, std::string name, std::string extra = {}, std::uint64_t number = 0) {
    name.resize(std::min(name.size(), kMaxNameBytes));
    link_.send({kind, number, std::move(name), std::move(extra), {}});
  }

  void wait() {
    std::vector<zmq::pollitem_t> items{{nullptr, link_.descriptor(), ZMQ_POLLIN, 0},
                                       {nullptr, released_.descriptor(), ZMQ_POLLIN, 0}};
    if (may_take_more()) items.push_back({router_.handle(), 0, ZMQ_POLLIN, 0});
    if (zap_) {
      items.push_back({zap_->requests().handle(), 0, ZMQ_POLLIN, 0});
      items.push_back({zap_->events().handle(), 0, ZMQ_POLLIN, 0});
    }
    const auto timeout = link_.has_more() ? std::chrono::milliseconds(0) : std::chrono::milliseconds(-1);
    uninterrupted([&] { return zmq::poll(items, timeout); });
  }

  bool take_frame() {
    zmq::message_t part;
    if (!receive(router_, part, zmq::recv_flags::dontwait)) return false;
    int parts = 0;
    zmq::message_t identity = std::move(part), head, payload;
    for (bool more = identity.more(); more;) {
      receive(router_, part, zmq::recv_flags::none);
      more = part.more();
      if (++parts == 1) head = std::move(part);
      if (parts == 2) payload = std::move(part);
      if (parts > kMostParts) throw std::runtime_error("a message has too many parts");
    }
    if (parts == 0) return true;  // a message without a sender
    if (parts != 2 || head.size() != sizeof(wire::FrameHeader)) {
      send(Kind::kNoFrame, identity.to_string(), key_of(head),
           pack_parts(static_cast<std::uint64_t>(parts), head.size()));
      return true;
    }
    const auto own = std::make_shared<zmq::message_t>(std::move(payload));
    link_.send({Kind::kFrame, 0, identity.to_string(), head.to_string() + key_of(head),
                Bytes({own, own->data<std::byte>()}, own->size())});
    return true;
  }

  void handle(Message message) {
    switch (message.kind) {
      case Kind::kPing:
        return send(Kind::kAlive, {});
      case Kind::kAuthenticated:
        if (zap_) zap_->finish(message.number == 1);
        return;
      case Kind::kReply:
        return reply(std::move(message));
      default:
        throw Broken("the daemon sent a message of unknown type");
    }
  }

  void reply(Message message) {
    zmq::message_t identity(message.name.data(), message.name.size());
    zmq::message_t head(message.extra.data(), message.extra.size()), payload;
    const std::uint64_t bytes = message.body.bytes;
    if (message.number) {
      auto* const data = const_cast<std::byte*>(message.body.begin.get());
      auto* hint = new Held{std::move(message.body), message.number, released_};
      payload.rebuild(data, bytes, &Held::give_back, hint);
    } else {
      payload.rebuild(message.body.begin.get(), bytes);
    }
    // With ROUTER_MANDATORY the first part fails if the client is gone (EHOSTUNREACH) or its queue is full.
    try {
      if (!clearance::send(router_, identity, zmq::send_flags::sndmore | zmq::send_flags::dontwait))
        return send(Kind::kNotDelivered, message.name);
      clearance::send(router_, head, zmq::send_flags::sndmore);
      clearance::send(router_, payload, zmq::send_flags::none);
    } catch (const zmq::error_t& error) {
      if (error.num() != EHOSTUNREACH) throw;
      send(Kind::kGone, message.name);
    }
  }

  Link& link_;
  std::uint64_t most_waiting_bytes_;  // bytes that may wait for the daemon before no more is taken from clients
  ReleasedReplies released_;
  zmq::context_t context_;
  std::optional<ZapHandler> zap_;
  zmq::socket_t router_;
};

}  // namespace

void serve_zmq(Link& link, const Message& start) {
  // Not destroyed, as the process ends with it and libzmq's end would wait for its threads.
  auto* const outside = new ZmqGateway(link, start);
  outside->run();
}

}  // namespace clearance::gateway
