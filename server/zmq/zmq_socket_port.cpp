// A ROUTER in this process, at a Unix socket.
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <zmq.hpp>

#include "server/access/fd_filter_proxy.h"
#include "server/base/unix_socket.h"
#include "server/gateway/zmq_router.h"
#include "server/zmq/zmq_port.h"
#include "wire/shm_os.h"
#include "wire/zmq_calls.h"

namespace clearance {
namespace {

/// Reply in a message of ZeroMQ, whose I/O thread calls give_back() once it was sent or dropped with its connection.
struct SentReply {
  std::byte* frame;
  std::uint64_t bytes;
  UnsentBytes unsent_bytes;

  static void give_back(void*, void* hint) {
    const std::unique_ptr<SentReply> self(static_cast<SentReply*>(hint));
    std::free(self->frame);
    *self->unsent_bytes -= self->bytes;
  }
};

/// Process at the other end of a Unix socket, from a property that libzmq gives a message ("PATH:UID:GID:PID").
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

/// Makes a Unix socket of this user that listens at `path`. Throws std::runtime_error.
shm::UniqueFd listen_on_ipc(const std::string& path, const std::string& endpoint) {
  sockaddr_un address;  // clear_stale_socket() has checked the length
  shm::socket_address(path.c_str(), address);
  shm::UniqueFd listener(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const mode_t mask = umask(077);
  const bool bound =
      listener && ::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  umask(mask);
  if (bound) reject_descriptors(listener.get());
  if (!bound || ::listen(listener.get(), kZmqBacklog) != 0)
    throw std::runtime_error(endpoint + ": cannot listen there: " + std::strerror(errno));
  return listener;
}

class ZmqSocketPort final : public ZmqPort {
 public:
  ZmqSocketPort(const std::string& endpoint, const Access& access) : socket_(context_, zmq::socket_type::router) {
    set_router_options(socket_, wire::kMaxRequestBytes);
    const std::string path = endpoint.substr(6);
    if (path.empty() || path[0] != '/')
      throw std::runtime_error(endpoint +
                               ": the path of the socket must be absolute, as in ipc:///run/user/1000/clearance.ipc");
    // ZeroMQ would replace any file at the path, even the socket of a live daemon, so it is checked first.
    const FolderLock lock(path);
    clear_stale_socket(path, endpoint);
    shm::UniqueFd listener = listen_on_ipc(path, endpoint);
    file_ = SocketFile(path);
    set_socket_mode(path, endpoint, access);
    socket_.set(zmq::sockopt::use_fd, listener.get());
    try {
      socket_.bind(endpoint);
    } catch (const zmq::error_t& error) {
      throw std::runtime_error(endpoint + ": cannot listen there: " + error.what());
    }
    listener.release();  // libzmq closes it
    url_ = socket_.get(zmq::sockopt::last_endpoint);
  }
  ~ZmqSocketPort() override {
    socket_.close();
    context_.close();  // its I/O thread removes the socket file, normally
    file_.remove();
  }

  std::string url() const override { return url_; }
  std::vector<int> descriptors() const override { return {socket_.get(zmq::sockopt::fd)}; }
  /// The descriptor reports changes only, not input that arrived before.
  bool has_work() override { return has_input(socket_); }

  bool receive(ZmqArrival& arrival) override {
    zmq::message_t part;
    if (!clearance::receive(socket_, part, zmq::recv_flags::dontwait)) return false;
    arrival = {};
    zmq::message_t head, payload;
    arrival.identity = part.to_string();
    for (bool more = part.more(); more;) {
      clearance::receive(socket_, part, zmq::recv_flags::none);
      more = part.more();
      if (++arrival.parts == 1) head = std::move(part);
      if (arrival.parts == 2) payload = std::move(part);
    }
    // The sender is a property of the parts from the wire; the identity is libzmq's own.
    arrival.who = sender_of(head);
    arrival.first_part_bytes = head.size();
    if (head.size() == sizeof arrival.header) std::memcpy(&arrival.header, head.data(), sizeof arrival.header);
    if (arrival.parts != 2 || head.size() != sizeof arrival.header) {
      arrival.what = ZmqArrival::What::kNoFrame;
      return true;
    }
    const auto own = std::make_shared<zmq::message_t>(std::move(payload));
    arrival.payload = {{own, own->data<std::byte>()}, own->size()};
    return true;
  }

  SendResult send(const std::string& to, AlignedBytes frame, std::uint64_t frame_bytes,
                  const UnsentBytes& unsent) override {
    const std::uint64_t payload_bytes = frame_bytes - sizeof(wire::FrameHeader);
    zmq::message_t identity(to.data(), to.size());
    zmq::message_t head(frame.get(), sizeof(wire::FrameHeader)), payload;
    std::byte* begin = frame.get() + sizeof(wire::FrameHeader);
    if (payload_bytes > kZmqCopyBytes) {
      auto* hint = new SentReply{frame.release(), payload_bytes, unsent};
      *unsent += payload_bytes;
      payload.rebuild(begin, payload_bytes, &SentReply::give_back, hint);
    } else {
      payload.rebuild(begin, payload_bytes);
    }
    // With ROUTER_MANDATORY the first part fails if the client is gone (EHOSTUNREACH) or its queue is full (EAGAIN).
    try {
      if (!clearance::send(socket_, identity, zmq::send_flags::sndmore | zmq::send_flags::dontwait))
        return SendResult::kQueueFull;
      clearance::send(socket_, head, zmq::send_flags::sndmore);
      clearance::send(socket_, payload, zmq::send_flags::none);
      return SendResult::kSent;
    } catch (const zmq::error_t& error) {
      if (error.num() != EHOSTUNREACH) throw;
      return SendResult::kNoPeer;
    }
  }

 private:
  std::string url_;
  SocketFile file_;
  zmq::context_t context_;
  zmq::socket_t socket_;
};

}  // namespace

std::unique_ptr<ZmqPort> open_zmq_socket(const std::string& endpoint, const Access& access) {
  return std::make_unique<ZmqSocketPort>(endpoint, access);
}

}  // namespace clearance
