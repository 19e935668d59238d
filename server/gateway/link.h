// Messages between the daemon and a gateway process (process.h), and one end of their link.
//
// Messages go through a pair of SOCK_SEQPACKET sockets, whose buffers bound the data under way. Long ones go in chunks,
// and those of several clients take turns. Each end checks every byte, as a gateway may have been taken over: a
// violation of these rules breaks the link and ends the gateway.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/base/fair_queue.h"
#include "wire/shm_os.h"

namespace clearance::gateway {

enum class Kind : std::uint32_t {
  // To the daemon.
  kReady = 1,        ///< body: why there is no filter of system calls, or nothing
  kFailed,           ///< body: reason for not starting
  kAlive,            ///< answers kPing
  kFrame,            ///< name: identity, extra: a frame's header and the client's key or none, body: its payload
  kNoFrame,          ///< name: identity, number: parts and bytes of the first (pack_parts())
  kReplyReleased,    ///< number: of a reply that the gateway holds no longer
  kGone,             ///< name: an identity without a connection
  kNotDelivered,     ///< name: an identity whose queue is full
  kAuthenticate,     ///< name: address, extra: key; answered by kAuthenticated
  kHandshakeFailed,  ///< name: endpoint
  // To the gateway.
  kStart,  ///< name: url, number: most bytes of a message, extra: secret key or none, body: channels
  kPing,
  kReply,          ///< name: identity, extra: a frame's header, body: its payload, number: for kReplyReleased, or 0
  kAuthenticated,  ///< number: 1 if the connection is accepted
  // Both ways.
  kPacket,  ///< name: LCM channel, body: a message
};

/// Bytes that are not modified after they were received.
struct Bytes {
  std::shared_ptr<const std::byte> begin;
  std::uint64_t bytes = 0;

  Bytes() = default;
  Bytes(std::shared_ptr<const std::byte> memory, std::uint64_t size) : begin(std::move(memory)), bytes(size) {}
  /// A copy, aligned to 64 bytes.
  explicit Bytes(std::span<const std::byte> of);
  explicit Bytes(std::string_view text) : Bytes(std::as_bytes(std::span(text))) {}
  std::span<const std::byte> span() const { return {begin.get(), static_cast<std::size_t>(bytes)}; }
  std::string text() const { return {reinterpret_cast<const char*>(begin.get()), static_cast<std::size_t>(bytes)}; }
};

struct Message {
  Kind kind{};
  std::uint64_t number = 0;
  std::string name, extra;
  Bytes body;
};

inline constexpr std::size_t kMaxNameBytes = 255, kMaxExtraBytes = 104;

/// The link is unusable: the other end is gone or violates the rules.
struct Broken : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Header of each datagram, followed by name, extra and a part of the body.
struct Head {
  std::uint32_t kind;
  std::uint16_t name_bytes, extra_bytes;
  std::uint64_t number, body_bytes, offset;  // of the whole body, and where the part begins
};
static_assert(sizeof(Head) == 32);

/// Sends kFailed without taking memory, for use when nothing else works.
void send_failed(int socket, std::string_view text);

class Link {
 public:
  struct Limits {
    std::uint64_t message_bytes;  ///< of an incoming body
    std::uint64_t coming_bytes;   ///< of all bodies received in part
    std::uint64_t waiting_bytes;  ///< to be sent; beyond it, a peer that does not read breaks the link
  };
  /// @param socket one end of a pair of non-blocking SOCK_SEQPACKET sockets
  Link(shm::UniqueFd socket, const Limits& limits);

  /// Descriptor that is readable when turn() or receive() has work.
  int descriptor() const { return epoll_.get(); }

  /// Sends a message as far as the socket takes it, and keeps the rest. Messages of one name keep their order. Throws
  /// Broken.
  void send(Message message);
  /// Bytes that wait to be sent.
  std::uint64_t waiting_bytes() const { return waiting_bytes_; }
  /// Begins a turn, which transfers a bounded number of bytes, and sends waiting messages. Throws Broken.
  void turn();
  /// Next message, or nothing if there is none or the turn is over. Throws Broken and std::bad_alloc.
  std::optional<Message> receive();
  /// Whether the turn ended with work left.
  bool has_more() const { return allowance_ == 0; }
  /// Bytes transferred in this turn.
  std::uint64_t turn_bytes() const { return kBytesPerTurn - allowance_; }
  /// Sets a function that frees memory which takes long to free.
  void drop_by(std::function<void(std::shared_ptr<void>)> drop) { drop_ = std::move(drop); }

 private:
  static constexpr std::size_t kChunkBytes = 64 << 10;
  static constexpr std::uint64_t kBytesPerTurn = 512 << 10;
  struct Leaving {
    Message message;
    std::uint64_t sequence, sent = 0;
  };
  struct InOrder {
    bool operator()(const Leaving& a, const Leaving& b) const { return a.sequence < b.sequence; }
  };
  struct Coming {
    Message message;
    std::shared_ptr<std::byte> memory;
    std::uint64_t got = 0;
  };

  bool send_chunk(Leaving& leaving);
  void keep(Leaving leaving);
  std::optional<Message> take(std::span<const std::byte> datagram);
  std::optional<Message> take_part(Message message, std::uint64_t offset, std::span<const std::byte> part);
  void spend(std::uint64_t bytes) { allowance_ -= std::min(allowance_, bytes + sizeof(Head)); }
  void watch_for_space(bool wanted);

  shm::UniqueFd socket_, epoll_;
  Limits limits_;
  std::vector<std::byte> buffer_;  // a datagram in transfer
  FairQueue<Leaving, InOrder> leaving_;
  std::unordered_map<std::string, Coming> coming_;
  std::uint64_t sequence_ = 0, waiting_bytes_ = 0, coming_bytes_ = 0, allowance_ = kBytesPerTurn;
  bool was_reset_ = false;  ///< the peer closed with unread input
  bool watches_for_space_ = false;
  std::function<void(std::shared_ptr<void>)> drop_;
};

/// Packs the number of parts of a message that is no frame, and the bytes of the first.
inline std::uint64_t pack_parts(std::uint64_t parts, std::uint64_t first_bytes) {
  constexpr std::uint64_t kMost = ~std::uint32_t{0};
  return std::min(parts, kMost) << 32 | std::min(first_bytes, kMost);
}

}  // namespace clearance::gateway
