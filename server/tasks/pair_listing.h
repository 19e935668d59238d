// The reply to a request for a list of pairs, made in slices: a few bytes can name many millions.
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

/// On the thread that works.
class PairListing {
 public:
  /// \param answers must outlive this. \param fetch brings the request's payload.
  PairListing(const ReplyWriter& answers, std::shared_ptr<const Engine> engine, const wire::FrameHeader& request,
              std::function<OwnPayload()> fetch)
      : answers_(answers), engine_(std::move(engine)), request_(request), fetch_(std::move(fetch)) {}

  /// Works for about `budget`. Returns the payload of kPairTable once it is whole. Throws what the request is refused
  /// for. \param ignored counts records of the request that nobody here knows.
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
