// Counters and errors for those who watch the daemon: HTTP/1.0, GET /metrics (Prometheus' text) and GET /errors.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "server/base/stats.h"
#include "server/base/unix_socket.h"
#include "wire/shm_os.h"

namespace clearance {

/// On a thread of its own, one request at a time, each within a second: who is slow keeps the others waiting for so
/// long, and the loop for nothing.
class MetricsServer {
 public:
  using Read = std::function<std::optional<Stats::MetricsSnapshot>()>;

  /// \param endpoint "127.0.0.1:PORT", "[::1]:PORT" (0: a free one) or a Unix socket's path, which is then mode 0600.
  /// \param read called on the server's thread; none: the daemon is too busy to say.
  /// Throws std::runtime_error with cause and place if it cannot listen there.
  MetricsServer(const std::string& endpoint, Read read);
  ~MetricsServer();
  /// "http://127.0.0.1:9464/metrics", or "unix:PATH".
  const std::string& url() const { return url_; }

 private:
  void run();
  void serve(int connection) const;
  std::string answer(const std::string& request) const;

  Read read_;
  SocketFile file_;
  shm::UniqueFd listener_, stop_;
  std::string url_;
  std::thread thread_;
};

}  // namespace clearance
