// Tells a supervisor that the daemon serves, and goes on serving.
#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace clearance {

/// What systemd left in NOTIFY_SOCKET and WATCHDOG_USEC, taken out of the environment so that no child process speaks
/// for us. Made before anything is loaded.
class Supervisor {
 public:
  Supervisor();
  /// READY=1, with a status line.
  void ready(const std::string& status) const;
  void stopping() const;
  /// WATCHDOG=1, four times in the interval that the supervisor asks for (WatchdogSec=); nothing if it asks for none.
  /// For the loop itself to call, so that a loop that stands still is noticed.
  void alive();

 private:
  void send(const std::string& state, int flags = 0) const;
  std::string socket_;
  std::chrono::microseconds watchdog_{0};  // zero: none
  std::chrono::steady_clock::time_point next_alive_;
};

/// Writes the urls to a descriptor, one on a line, and closes it.
void write_ready(int fd, const std::vector<std::string>& urls);

}  // namespace clearance
