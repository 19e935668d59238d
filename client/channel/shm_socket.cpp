#include "client/channel/shm_socket.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "client/channel/connection_errors.h"

namespace clearance {

namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
using shm::Message;
using shm::MessageKind;

Message message_of(MessageKind kind) {
  Message message;
  message.wire_version = wire::kVersion;
  message.kind = static_cast<std::uint32_t>(kind);
  return message;
}

std::string cause_of(int error) {
  switch (error) {
    case ENOENT:
      return "there is no socket: is clearanced running?";
    case ECONNREFUSED:
      return "no process listens there: the daemon is gone";
    case EPROTOTYPE:
      return "the socket there is not clearanced's";
    case EACCES:
      return "the socket belongs to another user, or its folder is not accessible";
    default:
      return std::strerror(error);
  }
}

}  // namespace

void ShmSocket::die(const std::string& why) {
  lost_ = url_ + ": " + why;
  throw ConnectionError(lost_);
}

ShmSocket::Fds ShmSocket::open(Deadline deadline) {
  connect(deadline);
  check_user();
  shm::send_message(socket_.get(), message_of(MessageKind::kHello));  // on failure, a reason for the rejection follows
  Fds fds;
  const Message answer = await_answer(deadline, {}, fds);
  if (static_cast<MessageKind>(answer.kind) == MessageKind::kRejected)
    throw ConnectionError(url_ + ": rejected: " + answer.text);
  if (!fds[0] || !fds[1]) throw ConnectionError(url_ + ": the daemon's greeting lacks the segment");
  return fds;
}

void ShmSocket::connect(Deadline deadline) {
  sockaddr_un address;
  if (!shm::socket_address(options_.path.c_str(), address))
    throw ConnectionError(url_ + ": a socket's path has 1 to " + std::to_string(sizeof address.sun_path - 1) +
                          " bytes");
  socket_.reset(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  if (!socket_) throw ConnectionError(url_ + ": socket: " + std::strerror(errno));
  const auto left = std::max<std::chrono::nanoseconds>(deadline - Clock::now(), 1ms);
  const timeval timeout{std::chrono::duration_cast<std::chrono::seconds>(left).count(),
                        std::chrono::duration_cast<std::chrono::microseconds>(left % 1s).count()};
  ::setsockopt(socket_.get(), SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof timeout);
  if (::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return;
  if (errno == EAGAIN || errno == EINPROGRESS) throw TimeoutError(url_ + ": the daemon does not take the connection");
  throw ConnectionError(url_ + ": " + cause_of(errno));
}

// Throws unless the socket is the permitted user's.
void ShmSocket::check_user() const {
  ucred peer{};
  socklen_t length = sizeof peer;
  if (::getsockopt(socket_.get(), SOL_SOCKET, SO_PEERCRED, &peer, &length) == 0 &&
      peer.uid == options_.user.value_or(::geteuid()))
    return;
  const std::string permitted =
      options_.user ? "user " + std::to_string(*options_.user) + "'s"
                    : "ours (user " + std::to_string(::geteuid()) + "); add ?user=NAME for the daemon of another user";
  throw ConnectionError(url_ + ": the socket is user " + std::to_string(peer.uid) + "'s, not " + permitted);
}

// Returns the daemon's next message, kSegment or kRejected. Throws ConnectionError, TimeoutError, DaemonHung.
Message ShmSocket::await_answer(Deadline deadline, const Channel::Watch& watch, Fds& fds) {
  for (bool reset = false;;) {
    Message message;
    const ssize_t received = shm::receive_message(socket_.get(), message, &fds);
    if (received < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      wait(deadline, watch);
      continue;
    }
    // The daemon closed the socket with unread data. Its last message can still be received.
    if (received < 0 && errno == ECONNRESET && !std::exchange(reset, true)) continue;
    if (received <= 0) die(received < 0 ? std::strerror(errno) : "the daemon closed the connection");
    message.text[sizeof message.text - 1] = '\0';
    if (static_cast<std::size_t>(received) < shm::kMessagePrefixBytes || message.magic != shm::kMagic)
      die("what listens there is not clearanced");
    const auto kind = static_cast<MessageKind>(message.kind);
    if (kind == MessageKind::kRejected) return message;
    if (message.layout_version != shm::kLayoutVersion || message.wire_version != wire::kVersion)
      die("the daemon speaks another version of the shared-memory layout");
    if (kind == MessageKind::kSegment) return message;
    die("the daemon sent a message of unknown kind");
  }
}

// Waits for a message until the deadline, or until the watch is due.
void ShmSocket::wait(Deadline deadline, const Channel::Watch& watch) {
  const Deadline until = watch ? std::min(deadline, watch()) : deadline;
  const auto left = std::max(std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()), 0ms);
  if (Clock::now() >= deadline) throw TimeoutError(url_ + ": the daemon does not answer on its socket");
  pollfd waiting{socket_.get(), POLLIN, 0};
  ::poll(&waiting, 1, static_cast<int>(std::min<std::chrono::milliseconds>(left, 1h).count()));
}

void ShmSocket::look() {
  Message message;
  const ssize_t received = shm::receive_message(socket_.get(), message);
  if (received < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
  message.text[sizeof message.text - 1] = '\0';
  const bool is_rejected = received > 0 && static_cast<MessageKind>(message.kind) == MessageKind::kRejected;
  lost_ = url_ + ": " + (is_rejected ? message.text : "the daemon is gone");
}

shm::UniqueFd ShmSocket::request_segment(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline,
                                         const Channel::Watch& watch, std::string& why) {
  Message wanted = message_of(MessageKind::kGrow);
  wanted.request_capacity = request_bytes;
  wanted.reply_capacity = reply_bytes;
  if (!shm::send_message(socket_.get(), wanted)) {
    look();
    lose("the daemon takes no messages");
    throw ConnectionError(lost_);
  }
  Fds fds;
  Message answer;
  try {
    answer = await_answer(deadline, watch, fds);
  } catch (const ConnectionError& error) {
    if (lost_.empty()) lost_ = error.what();  // a late answer would be assigned to another request
    throw;
  }
  if (static_cast<MessageKind>(answer.kind) != MessageKind::kRejected) return std::move(fds[0]);
  why = answer.text;
  return {};
}

bool ShmSocket::retire(std::uint32_t segment) {
  Message message = message_of(MessageKind::kRetire);
  message.segment_id = segment;
  return shm::send_message(socket_.get(), message);
}

}  // namespace clearance
