// How the LCM transport receives and sends packets: by its own sockets or by a gateway process.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/requests/transport.h"
#include "wire/lcm/lcm_bus.h"

namespace clearance {

/// Channels that the daemon listens to, without the prefix.
inline constexpr const char* kLcmChannelsIn[] = {
    "CLEARANCE_POSES",  "CLEARANCE_JOINTS", "CLEARANCE_MOVING_POSES", "CLEARANCE_MOVING_JOINTS",
    "CLEARANCE_POINTS", "CLEARANCE_QUERY",  "CLEARANCE_FRAME_IN",     "CLEARANCE_STATUS"};

class LcmPort {
 public:
  using Handler = LcmBus::Handler;

  virtual ~LcmPort() = default;

  /// Sets the handler of one of kLcmChannelsIn, once, before the first turn.
  /// @param queue messages kept between two turns
  virtual void subscribe(const std::string& name, int queue, Handler handler) = 0;
  virtual std::vector<int> descriptors() const = 0;
  /// Called before handle(), once a turn.
  virtual void begin_turn(RequestHandler&) {}
  /// Passes one message to its handler. Returns false if none waits.
  virtual bool handle() = 0;
  /// Whether there is work without a readable descriptor.
  virtual bool has_work() const { return false; }
  /// Sends a message. Returns false after an error, and never blocks for long.
  virtual bool publish(const std::string& name, std::span<const std::byte> message) = 0;
  virtual void tick(RequestHandler&) {}

  /// Encodes and sends a message of a generated type.
  template <class Message>
  bool publish_message(const std::string& name, const Message& message) {
    buffer_.resize(static_cast<std::size_t>(message.getEncodedSize()));
    const int size = message.encode(buffer_.data(), 0, static_cast<int>(buffer_.size()));
    return size >= 0 && publish(name, {buffer_.data(), static_cast<std::size_t>(size)});
  }

 private:
  std::vector<std::byte> buffer_;
};

/// Opens sockets if no packet leaves this machine (ttl 0), otherwise a gateway process. Throws std::runtime_error with
/// cause and remedy.
std::unique_ptr<LcmPort> open_lcm_port(const LcmAddress& address, std::uint64_t gateway_bytes);

}  // namespace clearance
