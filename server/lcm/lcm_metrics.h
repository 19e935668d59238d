// Metrics and log messages of the LCM transport.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <unordered_map>

#include "server/requests/transport.h"

namespace clearance {

/// Interval between equal log messages.
inline constexpr std::chrono::seconds kLcmRepeatInterval{5};

class LcmMetrics {
 public:
  explicit LcmMetrics(RequestHandler& handler);

  /// Logs a problem, at most every few seconds for each kind, with the number of those left out.
  void log_rate_limited(const char* kind, const std::string& what);
  /// Returns whether a message has no problem. Otherwise counts and logs it.
  bool accept(const std::string& problem) {
    if (problem.empty()) return true;
    ++bad;
    log_rate_limited("bad", "message rejected: " + problem);
    return false;
  }

  std::uint64_t &messages, &bad, &poses, &unknown, &gaps, &reordered, &repeated, &restarts, &contested, &bad_stamps,
      &not_allowed, &publishers, &queries, &frames, &clouds, &given_up, &replies, &dropped, &sent, &failed,
      &other_daemons;

 private:
  struct Suppressed {
    std::uint64_t times = 0, said = 0;
    std::chrono::steady_clock::time_point last;
  };
  std::unordered_map<std::string, Suppressed> suppressed_;
};

}  // namespace clearance
