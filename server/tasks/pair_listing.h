// The reply to a request for a list of pairs, made in slices as there may be millions.
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "server/tasks/query_reader.h"

namespace clearance {

/// Used on a worker.
class PairListing : private QueryReader {
 public:
  using QueryReader::QueryReader;

  /// Works for about `budget`. Returns the payload of kPairTable once it is complete. Throws RejectedRequest,
  /// QueryError or WireError.
  /// @param ignored count of unknown records, to which it adds
  std::optional<std::vector<std::byte>> advance(std::chrono::nanoseconds budget, std::uint64_t& ignored);

 private:
  using Clock = std::chrono::steady_clock;

  bool copy(Clock::time_point end);

  std::optional<PreparedQuery> prepared_;
  std::uint64_t copied_ = 0;  // pairs
  std::vector<std::byte> reply_;
};

}  // namespace clearance
