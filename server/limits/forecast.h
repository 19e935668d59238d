// Estimates the time of queries with a deadline from similar ones, so that those that cannot meet it are rejected at
// once.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>

#include "engine/engine.h"
#include "server/base/rejected_request.h"
#include "wire/query_options.h"

namespace clearance {

/// Used on the loop's thread.
class Forecast {
 public:
  using Clock = std::chrono::steady_clock;

  /// Properties of a query that determine its cost.
  struct Work {
    std::uint32_t kind = 0;
    std::uint64_t part_pairs = 0;
  };
  static Work work_of(const QueryOptions& query, const QueryCost& cost);

  /// Learns from a query's computing time, without its waiting time.
  /// @param is_whole false if it was given up
  void note(const Work& work, std::chrono::nanoseconds took, bool is_whole);
  /// Estimated time, or nothing if no similar query was seen.
  std::optional<std::chrono::nanoseconds> of(const Work& work) const;
  /// Throws RejectedRequest (kDeadline) if the estimate exceeds the time left. Each rejection lowers the estimate a
  /// little, so that after some of them one is tried.
  void check(const Work& work, std::chrono::nanoseconds left, std::chrono::nanoseconds deadline);

 private:
  static constexpr std::uint32_t kKinds = 48, kSizes = 32;
  static std::uint32_t index(const Work& work);

  std::array<double, std::size_t{kKinds} * kSizes> ns_per_part_pair_{};  // 0 if unknown
};

/// Rejection of a query whose deadline has passed.
/// @param worked time spent on it, or 0 if it had not begun
RejectedRequest deadline_passed(std::chrono::nanoseconds deadline, std::chrono::nanoseconds worked);

}  // namespace clearance
