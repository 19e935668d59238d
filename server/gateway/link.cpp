#include "server/gateway/link.h"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <utility>

#include "wire/aligned_buffer.h"

namespace clearance::gateway {
namespace {

/// Size from which memory takes long to free.
constexpr std::uint64_t kLarge = 1 << 20;
/// Overhead of a waiting message, next to its body.
constexpr std::uint64_t kMessageBytes = 512;

std::shared_ptr<std::byte> shared_bytes(std::uint64_t bytes) {
  AlignedBytes memory = aligned_bytes(bytes);
  return {memory.release(), FreeDeleter()};
}

}  // namespace

Bytes::Bytes(std::span<const std::byte> of) : bytes(of.size()) {
  if (of.empty()) return;
  std::shared_ptr<std::byte> memory = shared_bytes(of.size());
  std::memcpy(memory.get(), of.data(), of.size());
  begin = std::move(memory);
}

void send_failed(int socket, std::string_view text) {
  std::byte datagram[sizeof(Head) + 200];
  text = text.substr(0, sizeof datagram - sizeof(Head));
  const Head head{static_cast<std::uint32_t>(Kind::kFailed), 0, 0, 0, text.size(), 0};
  std::memcpy(datagram, &head, sizeof head);
  std::memcpy(datagram + sizeof head, text.data(), text.size());
  [[maybe_unused]] const auto sent = ::send(socket, datagram, sizeof head + text.size(), MSG_NOSIGNAL);
}

Link::Link(shm::UniqueFd socket, const Limits& limits)
    : socket_(std::move(socket)),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      limits_(limits),
      buffer_(sizeof(Head) + kMaxNameBytes + kMaxExtraBytes + kChunkBytes) {
  epoll_event event{};
  event.events = EPOLLIN;
  if (!epoll_ || ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, socket_.get(), &event) != 0)
    throw Broken(std::string("epoll: ") + std::strerror(errno));
}

void Link::send(Message message) {
  assert(message.name.size() <= kMaxNameBytes && message.extra.size() <= kMaxExtraBytes);
  Leaving leaving{std::move(message), ++sequence_};
  if (leaving_.empty() && leaving.message.body.bytes <= kChunkBytes && send_chunk(leaving)) return;
  waiting_bytes_ += kMessageBytes + leaving.message.body.bytes;
  if (waiting_bytes_ > limits_.waiting_bytes) throw Broken("it does not read its messages");
  keep(std::move(leaving));
}

void Link::keep(Leaving leaving) {
  const std::uint64_t turn = std::hash<std::string>()(leaving.message.name);
  leaving_.push(turn, std::move(leaving));
  watch_for_space(true);
}

/// Sends the next part of a body. Returns false if the socket is full.
bool Link::send_chunk(Leaving& leaving) {
  const Message& m = leaving.message;
  const std::size_t part = std::min<std::uint64_t>(m.body.bytes - leaving.sent, kChunkBytes);
  const Head head{static_cast<std::uint32_t>(m.kind),
                  static_cast<std::uint16_t>(m.name.size()),
                  static_cast<std::uint16_t>(m.extra.size()),
                  m.number,
                  m.body.bytes,
                  leaving.sent};
  std::byte* at = buffer_.data();
  const auto put = [&at](const void* from, std::size_t bytes) {
    if (bytes) std::memcpy(at, from, bytes);
    at += bytes;
  };
  put(&head, sizeof head);
  put(m.name.data(), m.name.size());
  put(m.extra.data(), m.extra.size());
  put(m.body.begin.get() + leaving.sent, part);
  // Sends without descriptors, by the only call that a gateway has for this socket.
  ssize_t sent;
  do sent = ::send(socket_.get(), buffer_.data(), static_cast<std::size_t>(at - buffer_.data()), MSG_NOSIGNAL);
  while (sent < 0 && errno == EINTR);
  if (sent < 0 && (errno == EAGAIN || errno == ENOBUFS)) return false;
  if (sent < 0) throw Broken("cannot send to it: " + std::string(std::strerror(errno)));
  leaving.sent += part;
  spend(part);
  return true;
}

void Link::turn() {
  allowance_ = kBytesPerTurn;
  while (!leaving_.empty() && allowance_ > 0) {
    Leaving next = leaving_.pop();
    const bool sent = send_chunk(next);
    if (!sent || next.sent < next.message.body.bytes) {
      keep(std::move(next));
      if (!sent) return;
      continue;
    }
    waiting_bytes_ -= kMessageBytes + next.message.body.bytes;
    if (drop_ && next.message.body.bytes > kLarge)
      drop_(std::const_pointer_cast<std::byte>(std::move(next.message.body.begin)));
  }
  watch_for_space(!leaving_.empty());
}

std::optional<Message> Link::receive() {
  while (allowance_ > 0) {
    const ssize_t got = ::recv(socket_.get(), buffer_.data(), buffer_.size(), MSG_TRUNC);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno == EAGAIN) return std::nullopt;
    // A peer that closes with unread input resets the connection, but its earlier messages can still be received.
    if (got < 0 && errno == ECONNRESET && !std::exchange(was_reset_, true)) continue;
    if (got < 0) throw Broken(std::strerror(errno));
    if (got == 0) throw Broken("it has gone");
    if (static_cast<std::size_t>(got) > buffer_.size()) throw Broken("it sends too large a datagram");
    if (auto whole = take({buffer_.data(), static_cast<std::size_t>(got)})) return whole;
  }
  return std::nullopt;
}

std::optional<Message> Link::take(std::span<const std::byte> datagram) {
  Head head;
  if (datagram.size() < sizeof head) throw Broken("it sends less than a header");
  std::memcpy(&head, datagram.data(), sizeof head);
  datagram = datagram.subspan(sizeof head);
  if (head.name_bytes > kMaxNameBytes || head.extra_bytes > kMaxExtraBytes ||
      datagram.size() < std::size_t{head.name_bytes} + head.extra_bytes)
    throw Broken("it sends a name or extra data of a wrong length");
  const auto text = [&datagram](std::size_t bytes) {
    const std::string taken(reinterpret_cast<const char*>(datagram.data()), bytes);
    datagram = datagram.subspan(bytes);
    return taken;
  };
  Message message{static_cast<Kind>(head.kind), head.number, text(head.name_bytes), text(head.extra_bytes), {}};
  spend(datagram.size());
  if (head.body_bytes > limits_.message_bytes) throw Broken("it sends too large a body");
  if (head.offset > head.body_bytes || datagram.size() > head.body_bytes - head.offset)
    throw Broken("it sends more of a body than announced");
  message.body.bytes = head.body_bytes;
  if (head.offset != 0 || datagram.size() != head.body_bytes || coming_.contains(message.name))
    return take_part(std::move(message), head.offset, datagram);
  message.body = Bytes(datagram);
  return message;
}

std::optional<Message> Link::take_part(Message message, std::uint64_t offset, std::span<const std::byte> part) {
  if (part.empty()) throw Broken("it sends an empty part of a body");
  auto found = coming_.find(message.name);
  if (found == coming_.end()) {
    if (offset != 0) throw Broken("it sends a body without its beginning");
    if (message.body.bytes > limits_.coming_bytes - coming_bytes_) throw Broken("it sends too many bodies at once");
    Coming begun{std::move(message), nullptr};
    begun.memory = shared_bytes(begun.message.body.bytes);
    coming_bytes_ += begun.message.body.bytes;
    found = coming_.emplace(begun.message.name, std::move(begun)).first;
  } else if (message.kind != found->second.message.kind || message.number != found->second.message.number ||
             message.extra != found->second.message.extra || message.body.bytes != found->second.message.body.bytes ||
             offset != found->second.got) {
    throw Broken("it mixes bodies of one name");
  }
  Coming& coming = found->second;
  std::memcpy(coming.memory.get() + offset, part.data(), part.size());
  coming.got += part.size();
  if (coming.got < coming.message.body.bytes) return std::nullopt;
  coming_bytes_ -= coming.message.body.bytes;
  Message whole = std::move(coming.message);
  whole.body.begin = std::move(coming.memory);
  coming_.erase(found);
  return whole;
}

void Link::watch_for_space(bool wanted) {
  if (wanted == std::exchange(watches_for_space_, wanted)) return;
  epoll_event event{};
  event.events = EPOLLIN | (wanted ? EPOLLOUT : 0u);
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, socket_.get(), &event);
}

}  // namespace clearance::gateway
