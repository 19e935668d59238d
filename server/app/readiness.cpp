#include "server/app/readiness.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace clearance {

Supervisor::Supervisor() {
  if (const char* socket = std::getenv("NOTIFY_SOCKET")) socket_ = socket;
  // sd_watchdog_enabled(3): the interval applies to this process unless WATCHDOG_PID names another one.
  const char *interval = std::getenv("WATCHDOG_USEC"), *pid = std::getenv("WATCHDOG_PID");
  if (interval && (!pid || pid == std::to_string(getpid()))) {
    std::int64_t us = 0;
    const char* end = interval + std::strlen(interval);
    if (const auto read = std::from_chars(interval, end, us); read.ec == std::errc() && read.ptr == end && us > 0)
      watchdog_ = std::chrono::microseconds(us);
  }
  for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
}

void Supervisor::ready(const std::string& status) const {
  send("READY=1\nSTATUS=" + status);
}
void Supervisor::stopping() const {
  send("STOPPING=1");
}
void Supervisor::alive() {
  const auto now = std::chrono::steady_clock::now();
  if (watchdog_.count() == 0 || now < next_alive_) return;
  next_alive_ = now + watchdog_ / 4;
  send("WATCHDOG=1", MSG_DONTWAIT);  // must not block the loop if the supervisor does not read
}

// The protocol of sd_notify(3): one datagram to a Unix socket, whose name is abstract if it begins with '@'.
void Supervisor::send(const std::string& state, int flags) const {
  sockaddr_un address{};
  if (socket_.empty() || socket_.size() >= sizeof address.sun_path) return;
  address.sun_family = AF_UNIX;
  socket_.copy(address.sun_path, socket_.size());
  if (address.sun_path[0] == '@') address.sun_path[0] = '\0';
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return;
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + socket_.size());
  // A supervisor that does not listen is no error.
  [[maybe_unused]] const auto sent =
      sendto(fd, state.data(), state.size(), MSG_NOSIGNAL | flags, reinterpret_cast<const sockaddr*>(&address), size);
  close(fd);
}

void write_ready(int fd, const std::vector<std::string>& urls) {
  std::string text;
  for (const std::string& url : urls) text += url + "\n";
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t written = write(fd, text.data() + at, text.size() - at);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) break;  // the reader is gone
    at += static_cast<std::size_t>(written);
  }
  close(fd);
}

}  // namespace clearance
