// Tells a supervisor that the daemon serves.
#pragma once

#include <string>
#include <vector>

namespace clearance {

/// What systemd left in NOTIFY_SOCKET, taken out of the environment so that no child process speaks for us. Made before
/// anything is loaded.
class Supervisor {
 public:
  Supervisor();
  /// READY=1, with a status line.
  void ready(const std::string& status) const;
  void stopping() const;

 private:
  void send(const std::string& state) const;
  std::string socket_;
};

/// Writes the urls to a descriptor, one on a line, and closes it.
void write_ready(int fd, const std::vector<std::string>& urls);

}  // namespace clearance
