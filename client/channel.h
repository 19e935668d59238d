// One connection to a daemon, whatever carries it: frames out, frames in, matched by request id.
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
/// Request ids from here on are of what the library itself asks: a caller's requests count from 1.
inline constexpr std::uint64_t kOwnRequests = std::uint64_t{1} << 62;
/// Of an echo that nobody reads: that it comes is a sign of life.
inline constexpr std::uint64_t kSignRequest = kOwnRequests | std::uint64_t{1} << 61;
struct ConnectOptions;

/// A frame that arrived. The bytes stay valid until the frame is destroyed (shared memory: a leased slot).
class Frame {
 public:
  virtual ~Frame() = default;
  virtual const wire::FrameHeader& header() const = 0;     ///< already validated
  virtual std::span<const std::byte> payload() const = 0;  ///< starts on a 64-byte boundary
};

/// Not thread-safe: one channel per thread, or a lock around it.
class Channel {
 public:
  /// Looks whether the daemon hangs, and throws DaemonHung if it does. Returns when to look again.
  using Watch = std::function<Deadline()>;

  virtual ~Channel() = default;

  /// What begin() and receive() call while they themselves wait for the daemon. Empty: nobody looks.
  void watch_by(Watch watch) { watch_ = std::move(watch); }

  /// Room for a request frame of `frame_bytes` with a reply of about `reply_bytes` (0: unknown), 64-byte aligned.
  /// Throws ConnectionError (also if every slot of a shared segment is taken by frames the caller still holds), what
  /// the watch throws, and RequestError with kTooLarge if the daemon refuses so large a request. The room is the
  /// caller's until send().
  virtual std::byte* begin(std::uint64_t frame_bytes, std::uint64_t reply_bytes) = 0;
  /// Sends the frame written there; its header must be whole. Throws ConnectionError.
  virtual void send() = 0;
  /// The reply to `request_id`, or null once `deadline` has passed. Replies to other outstanding requests are kept.
  /// Throws ConnectionError if the daemon is gone.
  virtual std::unique_ptr<Frame> receive(std::uint64_t request_id, Deadline deadline) = 0;
  /// Gives up on a request: its reply is dropped when it comes.
  virtual void forget(std::uint64_t request_id) = 0;
  /// Whether the connection has ended for good, as far as was noticed: it sends nothing any more. Where there is no
  /// connection underneath (LCM), never.
  virtual bool lost() const { return false; }
  /// Goes on with the daemon that answers now, where the transport does not say which one that is (LCM). Throws
  /// ConnectionError if none or several do.
  virtual void bind(Deadline) {}
  /// Whether a frame may be lost on its way, without a word.
  virtual bool may_lose() const { return false; }
  /// A number that is another one each time, as long as the daemon's loop goes round; 0: this daemon shows none. Asks
  /// for the next sign, where the daemon gives none by itself.
  virtual std::uint64_t sign_of_life() = 0;
  /// Whether signs of life come behind the frames that are on their way.
  virtual bool signs_queue_up() const { return true; }
  virtual std::string url() const = 0;

 protected:
  Deadline watch() const { return watch_ ? watch_() : Deadline::max(); }

 private:
  Watch watch_;
};

/// For CURVE: whom the client takes for the daemon, and who it is itself. Empty: without keys.
struct ChannelKeys {
  std::string server;  ///< public
  KeyPair own;
};

/// Connects by whatever transport the url names (client.h). Throws ConnectionError, and std::invalid_argument for a bad
/// url.
std::unique_ptr<Channel> open_channel(const std::string& url, const ConnectOptions& options, Deadline deadline);
/// Each connects or throws ConnectionError (client.h) naming the url and the cause.
std::unique_ptr<Channel> open_zmq_channel(const std::string& endpoint, const ChannelKeys& keys, Deadline deadline);
/// \param socket_path may end in options: "/run/clearance/clearance.sock?spin_us=50&user=clearance" (0: never spin;
/// default
/// 20. Whose daemon is meant; default our own user's).
std::unique_ptr<Channel> open_shm_channel(const std::string& socket_path, Deadline deadline);
std::unique_ptr<Channel> open_lcm_channel(const std::string& lcm_url, const std::string& channel_prefix,
                                          Deadline deadline);

}  // namespace clearance
