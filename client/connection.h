// A client's connection to the daemon at one of its urls, which can be lost, hang, or be replaced by another daemon.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/channel/channel.h"
#include "client/channel/hang_watch.h"
#include "client/client.h"
#include "wire/fork_guard.h"

namespace clearance {

/// Returns `duration` from now, clamped to the range of the clock.
Deadline deadline_in(std::chrono::nanoseconds duration);

/// Formats a duration for messages, such as "1.5 s".
std::string seconds(std::chrono::nanoseconds duration);

/// Not thread-safe, like its channel.
class Connection {
 public:
  /// Connects to the first url that responds. Throws ConnectionError, and std::invalid_argument for an invalid url.
  Connection(std::span<const std::string> urls, const ConnectOptions& options);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  const std::string& url() const { return url_; }
  bool forked() const { return fork_guard_.forked(); }
  std::chrono::nanoseconds timeout() const { return timeout_; }
  void set_timeout(std::chrono::nanoseconds timeout) { timeout_ = timeout; }

  /// Reconnects if the last connection was lost. Returns the records at the end of each request: the epoch, if any.
  /// Call it before begin().
  const std::vector<std::byte>& prepare();
  /// As in Channel.
  std::byte* begin(std::uint64_t frame_bytes, std::uint64_t reply_bytes);
  void send() { channel_->send(); }
  /// Returns the reply, or null after `deadline`. Throws ConnectionError, DaemonHung.
  std::unique_ptr<Frame> await(std::uint64_t request_id, Deadline deadline);
  void forget(std::uint64_t request_id) { channel_->forget(request_id); }

  /// Header of the next request, which ends in `records_bytes` of records.
  wire::FrameHeader next_header(wire::FrameType type, std::uint64_t payload_bytes, std::uint64_t scene_revision,
                                std::uint64_t records_bytes);

  /// Epoch of the daemon that requests are for, or 0.
  std::uint64_t epoch() const { return epoch_; }
  /// Accepts the current daemon for requests, and returns its epoch.
  std::uint64_t acknowledge_epoch();

 private:
  void check_process() const;
  Deadline look_for_hang(Deadline now);
  void connect_to(std::size_t first, std::chrono::nanoseconds patience);
  void connect_anew();
  void meet(Deadline deadline);

  std::vector<std::string> urls_;
  ConnectOptions options_;
  std::chrono::nanoseconds hang_;
  std::chrono::nanoseconds timeout_ = std::chrono::seconds(5);
  ForkGuard fork_guard_;
  std::unique_ptr<Channel> channel_;
  HangWatch watch_;
  std::size_t at_ = 0;  ///< index into urls_
  std::string url_;
  bool has_hung_ = false;
  bool has_met_ = false;
  std::uint64_t epoch_ = 0;
  std::vector<std::byte> epoch_record_;
  std::uint64_t next_request_id_ = 1, oldest_request_id_ = 1;  ///< lower ones were sent over a lost connection
  std::uint64_t next_own_request_ = kOwnRequests;
};

}  // namespace clearance
