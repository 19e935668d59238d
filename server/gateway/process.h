// A gateway process between the network and the daemon. It runs the libraries that parse data of unauthenticated peers,
// under limits of memory and system calls, and passes on the result. It is restarted whenever it ends.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "server/gateway/link.h"
#include "server/requests/transport.h"

namespace clearance::gateway {

/// Configuration of a gateway.
struct ProcessOptions {
  std::string url;                             ///< for the log
  std::string what;                            ///< "zmq" or "lcm", as clearance-gateway reads it
  std::uint64_t memory_bytes = kGatewayBytes;  ///< of address space
  std::uint32_t connections = 0;               ///< most connections
  Message start;                               ///< first message to the gateway
  shm::UniqueFd listener;                      ///< where it accepts connections, or none
};

/// Used on the loop's thread.
class Process {
 public:
  using Clock = std::chrono::steady_clock;

  /// Starts the gateway and waits until it is ready. Throws std::runtime_error with the url and the cause.
  explicit Process(ProcessOptions options);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Largest message to or from a gateway with so much memory.
  static std::uint64_t message_bytes(std::uint64_t memory_bytes) { return memory_bytes / 8; }
  std::uint64_t message_bytes() const { return message_bytes(options_.memory_bytes); }

  /// Descriptor that is readable when poll() may have work, or -1 while there is no process.
  int descriptor() const { return link_ ? link_->descriptor() : -1; }
  /// Null while there is no process.
  Link* link() { return link_ ? &*link_ : nullptr; }
  /// Begins a turn. Returns true if the former process was lost, and with it all its clients.
  bool turn(RequestHandler& handler);
  /// Next message that is not for this object. After a loss there is none, and turn() returns true.
  std::optional<Message> receive();
  void send(Message message);
  /// Ends a process that violates the rules.
  void lose(const std::string& why);
  bool has_more() const { return lost_ || (link_ && link_->has_more()); }
  /// Restarts the process when its pause is over, and checks that it is alive and its size.
  void tick(RequestHandler& handler);

 private:
  void start();
  void wait_until_ready();
  std::optional<Message> take_own(Message message);
  void reap(bool wait);
  void count_memory(RequestHandler& handler, std::uint64_t bytes);
  std::uint64_t resident_bytes() const;

  ProcessOptions options_;
  std::optional<Link> link_;
  pid_t pid_ = -1;
  std::vector<pid_t> ending_;
  bool ready_ = false, lost_ = false, reported_unfiltered_ = false;
  std::string why_lost_;
  std::optional<std::string> failed_;
  Clock::time_point started_, next_start_, next_check_, last_alive_;
  Clock::duration pause_{};
  std::uint64_t memory_counted_ = 0;
};

}  // namespace clearance::gateway
