// The socket of a shared-memory connection: who listens there, the handshake, new segments, and the daemon's end.
#pragma once

#include <array>
#include <string>

#include "client/channel/channel.h"
#include "client/channel/shm_options.h"
#include "wire/shm_layout.h"
#include "wire/shm_os.h"

namespace clearance {

/// Not thread-safe. Calls throw ConnectionError with the url and the cause.
class ShmSocket {
 public:
  using Fds = std::array<shm::UniqueFd, shm::kMaxPassedFds>;

  ShmSocket(std::string url, ShmOptions options) : url_(std::move(url)), options_(std::move(options)) {}

  /// Connects to the daemon of the permitted user. Returns its first segment, and the eventfd that wakes it. Throws
  /// TimeoutError, too.
  Fds open(Deadline deadline);
  /// Requests a segment with slots of at least these sizes. Returns its fd, or none with `why` if the daemon rejects it.
  /// \param watch called while it waits; throws DaemonHung
  shm::UniqueFd request_segment(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline,
                                const Channel::Watch& watch, std::string& why);
  /// Returns whether the daemon was informed that a segment is no longer used.
  bool retire(std::uint32_t segment);
  /// Detects the loss of the daemon. Replies that it had posted can still be received.
  void look();

  /// The reason that the connection is unusable, or empty.
  const std::string& lost() const { return lost_; }
  void lose(const std::string& why) {
    if (lost_.empty()) lost_ = url_ + ": " + why;
  }
  [[noreturn]] void die(const std::string& why);

 private:
  void connect(Deadline deadline);
  void check_user() const;
  shm::Message await_answer(Deadline deadline, const Channel::Watch& watch, Fds& fds);
  void wait(Deadline deadline, const Channel::Watch& watch);

  std::string url_;
  ShmOptions options_;
  shm::UniqueFd socket_;
  std::string lost_;
};

}  // namespace clearance
