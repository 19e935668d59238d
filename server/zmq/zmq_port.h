// How the ZeroMQ transport receives and sends messages: by its own socket or by a gateway process.
#pragma once

#include <sys/socket.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/access/access.h"
#include "server/requests/transport.h"
#include "wire/aligned_buffer.h"

namespace clearance {

/// A message or event from a port.
struct ZmqArrival {
  enum class What {
    kFrame,
    kNoFrame,       ///< a message that is not a header and a payload
    kClientGone,    ///< the client of that identity
    kNotDelivered,  ///< a reply to it
    kAllGone,       ///< every client
  };
  What what = What::kFrame;
  std::string identity;
  std::optional<ucred> who;                       ///< over ipc://
  std::string key;                                ///< of the client, or empty
  wire::FrameHeader header{};                     ///< kFrame
  OwnPayload payload;                             ///< kFrame
  std::uint64_t parts = 0, first_part_bytes = 0;  ///< kNoFrame
};

/// Bytes of replies to one client that have not left the daemon.
using UnsentBytes = std::shared_ptr<std::atomic<std::uint64_t>>;

class ZmqPort {
 public:
  virtual ~ZmqPort() = default;

  virtual std::string url() const = 0;
  virtual std::vector<int> descriptors() const = 0;
  /// Called before receive(), once a turn.
  virtual void begin_turn(RequestHandler&) {}
  /// Returns false if there is nothing, or the turn's work is done.
  virtual bool receive(ZmqArrival& arrival) = 0;
  /// Whether there is work without a readable descriptor.
  virtual bool has_work() = 0;
  /// Largest frame that can be sent to a client.
  virtual std::uint64_t max_reply_bytes() const { return wire::kMaxFrameBytes; }

  enum class SendResult { kSent, kQueueFull, kNoPeer };
  /// Counts a large payload in `unsent` until it has left.
  virtual SendResult send(const std::string& identity, AlignedBytes frame, std::uint64_t frame_bytes,
                          const UnsentBytes& unsent) = 0;
  virtual void tick(RequestHandler&) {}
};

/// Opens "ipc:///path". Throws std::runtime_error.
std::unique_ptr<ZmqPort> open_zmq_socket(const std::string& endpoint, const Access& access);
/// Opens "tcp://127.0.0.1:5555" by a gateway process. Throws std::runtime_error.
std::unique_ptr<ZmqPort> open_zmq_gateway(const std::string& endpoint, const Access& access);

}  // namespace clearance
