// A process that stands between the network and the core: it reads what strangers send, in the libraries that do so,
// under limits of memory and system calls, and hands on what it made of that. Whatever ends it, another one is started.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "server/gateway/link.h"
#include "server/requests/transport.h"

namespace clearance::gateway {

/// What a process outside is to do.
struct Plan {
  std::string url;                             ///< for the log
  std::string what;                            ///< "zmq" or "lcm", as clearance-outside reads it
  std::uint64_t memory_bytes = kGatewayBytes;  ///< address space that it may take
  std::uint32_t connections = 0;               ///< that it may hold
  Message start;                               ///< the first that it is told
  shm::UniqueFd listener;                      ///< where it takes connections; none
};

/// On the loop's thread.
class Process {
 public:
  using Clock = std::chrono::steady_clock;

  /// Starts it, and waits until it is ready. Throws std::runtime_error naming the url and the cause.
  explicit Process(Plan plan);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Limits of what a process of so much memory may be sent, and may send.
  static std::uint64_t message_bytes(std::uint64_t memory_bytes) { return memory_bytes / 8; }
  std::uint64_t message_bytes() const { return message_bytes(plan_.memory_bytes); }

  /// Readable when poll() may have work; -1 while there is no process.
  int descriptor() const { return link_ ? link_->descriptor() : -1; }
  /// Null while there is no process.
  Link* link() { return link_ ? &*link_ : nullptr; }
  /// Begins a turn with the process. True: the one that was there is lost, and with it everybody who came through it.
  bool turn(RequestHandler& handler);
  /// The next message that is not for this object. Once the process is lost there is none, and turn() says so.
  std::optional<Message> receive();
  void send(Message message);
  /// Ends a process that does not keep to the rules.
  void lose(const std::string& why);
  bool has_more() const { return lost_ || (link_ && link_->has_more()); }
  /// Starts another one when its time has come; looks whether the one that is there is alive, and how large.
  void tick(RequestHandler& handler);

 private:
  void start();
  void wait_until_ready();
  std::optional<Message> take_own(Message message);
  void reap(bool wait);
  void count_memory(RequestHandler& handler, std::uint64_t bytes);
  std::uint64_t resident_bytes() const;

  Plan plan_;
  std::optional<Link> link_;
  pid_t pid_ = -1;
  std::vector<pid_t> ending_;
  bool ready_ = false, lost_ = false, reported_unfiltered_ = false;
  std::string why_lost_;
  std::optional<std::string> failed_;
  Clock::time_point started_, next_start_, next_look_, last_alive_;
  Clock::duration pause_{};
  std::uint64_t memory_counted_ = 0;
};

}  // namespace clearance::gateway
