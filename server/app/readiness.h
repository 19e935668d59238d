// Reports to a supervisor that the daemon serves, and keeps serving.
#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace clearance {

/// Values of NOTIFY_SOCKET and WATCHDOG_USEC, removed from the environment so that no child process reports in this
/// one's name. Made before anything is loaded.
class Supervisor {
 public:
  Supervisor();
  /// Sends READY=1 with a status line.
  void ready(const std::string& status) const;
  void stopping() const;
  /// Sends WATCHDOG=1, four times in the supervisor's interval (WatchdogSec=), if it has one. Called by the loop, so
  /// that a hung loop is detected.
  void alive();

 private:
  void send(const std::string& state, int flags = 0) const;
  std::string socket_;
  std::chrono::microseconds watchdog_{0};  // zero if there is none
  std::chrono::steady_clock::time_point next_alive_;
};

/// Writes the urls to a descriptor, one per line, and closes it.
void write_ready(int fd, const std::vector<std::string>& urls);

}  // namespace clearance
