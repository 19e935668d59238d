// The reply to a request for a list of pairs, made in slices as there may be millions.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "engine/engine.h"
#include "server/requests/reply_writer.h"
#include "server/requests/transport.h"

namespace clearance {

/// Used on a worker.
class PairListing {
 public:
  /// @param answers outlives this
  /// @param fetch brings the request's payload
  PairListing(const ReplyWriter& answers, std::shared_ptr<const Engine> engine, const wire::FrameHeader& request,
              std::function<OwnPayload()> fetch)
      : answers_(answers), engine_(std::move(engine)), request_(request), fetch_(std::move(fetch)) {}

  /// Works for about `budget`. Returns the payload of kPairTable once it is complete. Throws RejectedRequest,
  /// QueryError or WireError.
  /// @param ignored count of unknown records, to which it adds
  std::optional<std::vector<std::byte>> advance(std::chrono::nanoseconds budget, std::uint64_t& ignored);

 private:
  using Clock = std::chrono::steady_clock;

  void begin(std::uint64_t& ignored);
  bool copy(Clock::time_point end);

  const ReplyWriter& answers_;
  std::shared_ptr<const Engine> engine_;
  wire::FrameHeader request_;
  std::function<OwnPayload()> fetch_;
  OwnPayload payload_;
  std::vector<std::uint64_t> aligned_;
  std::optional<PreparedQuery> prepared_;
  std::uint64_t copied_ = 0;  // pairs
  std::vector<std::byte> reply_;
};

}  // namespace clearance
