// What queries with a deadline will take, told by what like ones took: so that one that cannot be answered in time is
// refused before anybody works on it.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>

#include "engine/engine.h"
#include "server/base/rejected_request.h"
#include "wire/query_options.h"

namespace clearance {

/// Used from the loop's thread.
class Forecast {
 public:
  using Clock = std::chrono::steady_clock;

  /// What a query asks for, as far as its cost goes.
  struct Work {
    std::uint32_t kind = 0;
    std::uint64_t piece_pairs = 0;
  };
  static Work work_of(const QueryOptions& query, const QueryCost& extent);

  /// Learns from a query that took so long, without its waiting. \param is_whole false: it was given up then.
  void note(const Work& work, std::chrono::nanoseconds took, bool is_whole);
  /// How long one takes; none: nothing like it was seen.
  std::optional<std::chrono::nanoseconds> of(const Work& work) const;
  /// Throws a Refusal (kDeadline) if one takes longer than what is left. Each refusal lowers the figure a little, since
  /// a query that is always refused shows nothing new: after some of them one is tried.
  void check(const Work& work, std::chrono::nanoseconds left, std::chrono::nanoseconds deadline);

 private:
  static constexpr std::uint32_t kKinds = 96, kSizes = 32;
  static std::uint32_t index(const Work& work);

  std::array<double, std::size_t{kKinds} * kSizes> ns_per_piece_pair_{};  // 0: nothing is known
};

/// What is said of a query whose deadline has passed. \param worked so long somebody worked on it; 0: it had not begun
RejectedRequest deadline_passed(std::chrono::nanoseconds deadline, std::chrono::nanoseconds worked);

}  // namespace clearance
