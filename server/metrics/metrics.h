// HTTP server for counters and errors: `GET /metrics` (Prometheus' text) and `GET /errors`.
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

/// Serves one request at a time on a thread of its own, each within a second, so a slow client delays only other
/// clients.
class MetricsServer {
 public:
  using Read = std::function<std::optional<Stats::MetricsSnapshot>()>;

  /// Throws std::runtime_error with cause and place if it cannot listen.
  /// @param endpoint "127.0.0.1:PORT", "[::1]:PORT" (0 for a free port) or the path of a Unix socket, which gets mode
  /// 0600
  /// @param read called on the server's thread; returns nothing if the daemon is too busy
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
