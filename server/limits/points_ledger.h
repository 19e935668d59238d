// How many points the scene's bodies of points have, and from whom: what is more is refused, so that no client fills
// the daemon's memory with them.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

namespace clearance {

/// Used from the loop's thread. A point takes about 60 bytes, its share of the tree included.
class PointsLedger {
 public:
  struct Limits {
    std::uint64_t max_points_of_body = 2'000'000;    ///< of one update; more: kTooLarge
    std::uint64_t max_points_of_client = 8'000'000;  ///< that a client set, and has under way; more: kTooLarge
    std::uint64_t max_points = 16'000'000;           ///< of all clients; more: kBusy
  };

  explicit PointsLedger(const Limits& limits) : limits_(limits) {}

  /// Counts points that are under way, beside those that they will replace. Throws a Refusal where that is too many.
  void begin(std::uint64_t client, std::uint64_t count);
  /// They are a body's now, in place of what it had or, where that could not be, gone.
  void end(std::uint64_t client, const std::string& body, std::uint64_t count, bool replaced);

 private:
  struct Held {
    std::uint64_t client = 0, count = 0;
  };

  Limits limits_;
  std::unordered_map<std::string, Held> bodies_;                // by name
  std::unordered_map<std::uint64_t, std::uint64_t> under_way_;  // by client
};

}  // namespace clearance
