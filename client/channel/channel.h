// One connection to a daemon over any transport: sends and receives frames, matched by request id.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "wire/key_file.h"
#include "wire/protocol.h"

namespace clearance {

using Deadline = std::chrono::steady_clock::time_point;
/// First id of the library's own requests; a caller's requests count from 1.
inline constexpr std::uint64_t kOwnRequests = std::uint64_t{1} << 62;
/// Id of an echo request whose reply only serves as a sign of life.
inline constexpr std::uint64_t kSignRequest = kOwnRequests | std::uint64_t{1} << 61;
struct ConnectOptions;

/// A received frame. The bytes are valid until its destruction (over shared memory, it leases a slot).
class Frame {
 public:
  virtual ~Frame() = default;
  virtual const wire::FrameHeader& header() const = 0;     ///< already validated
  virtual std::span<const std::byte> payload() const = 0;  ///< aligned to 64 bytes
};

class Result;  // wire/api/result.h
/// The result in a frame of type kReply, whose memory it shares. Throws ConnectionError if the frame is malformed.
Result result_of(std::unique_ptr<Frame> frame);

/// Not thread-safe; use one channel per thread, or a lock.
class Channel {
 public:
  /// Throws DaemonHung if the daemon hangs. Returns the time of the next check.
  using Watch = std::function<Deadline()>;

  virtual ~Channel() = default;

  /// Sets the check that begin() and receive() call while they wait for the daemon; empty for none.
  void watch_by(Watch watch) { watch_ = std::move(watch); }

  /// Returns memory for a request frame of `frame_bytes`, 64-byte aligned, valid until send(). `reply_bytes` estimates
  /// the reply (0 if unknown). Throws ConnectionError (also if the caller's frames occupy every slot of a shared
  /// segment), DaemonHung of the watch, and RequestError with kTooLarge if the daemon rejects the size.
  virtual std::byte* begin(std::uint64_t frame_bytes, std::uint64_t reply_bytes) = 0;
  /// Sends the frame written there, with a complete header. Throws ConnectionError.
  virtual void send() = 0;
  /// Returns the reply to `request_id`, or null after `deadline`. Replies to other pending requests are kept. Throws
  /// ConnectionError if the daemon is lost.
  virtual std::unique_ptr<Frame> receive(std::uint64_t request_id, Deadline deadline) = 0;
  /// Abandons a request. Its reply is dropped on arrival.
  virtual void forget(std::uint64_t request_id) = 0;
  /// Whether the connection is known to be lost, so that it cannot send. Never true without a connection (LCM).
  virtual bool lost() const { return false; }
  /// Binds to the daemon that responds now, for a transport without connections (LCM). Throws ConnectionError if none
  /// or several respond.
  virtual void bind(Deadline) {}
  /// Whether frames can be lost silently.
  virtual bool may_lose() const { return false; }
  /// Returns a number that changes as long as the daemon's loop runs; 0 for a daemon without such a sign. Also requests
  /// the next sign if the daemon does not give it by itself.
  virtual std::uint64_t sign_of_life() = 0;
  /// Whether signs of life queue behind frames in transit.
  virtual bool signs_queue_up() const { return true; }
  virtual std::string url() const = 0;

 protected:
  Deadline watch() const { return watch_ ? watch_() : Deadline::max(); }

 private:
  Watch watch_;
};

/// CURVE keys of the daemon and of the client; empty without keys.
struct ChannelKeys {
  std::string server;  ///< the daemon's public key
  KeyPair own;
};

/// Connects over the transport of the url (client.h). Throws ConnectionError, and std::invalid_argument for an invalid
/// url.
std::unique_ptr<Channel> open_channel(const std::string& url, const ConnectOptions& options, Deadline deadline);
/// Each connects or throws ConnectionError (client.h) naming the url and the cause.
std::unique_ptr<Channel> open_zmq_channel(const std::string& endpoint, const ChannelKeys& keys, Deadline deadline);
/// \param socket_path path with optional options, such as "/run/clearance/clearance.sock?spin_us=50&user=clearance":
/// the spin time (default 20, 0 to never spin) and the user of the daemon (default this user)
std::unique_ptr<Channel> open_shm_channel(const std::string& socket_path, Deadline deadline);
std::unique_ptr<Channel> open_lcm_channel(const std::string& lcm_url, const std::string& channel_prefix,
                                          Deadline deadline);

}  // namespace clearance
