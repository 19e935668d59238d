// Queries that wait for poses (QueryOptions::min_pose_stamp_ns): held aside, so that they hold nobody up, and looked at
// when poses have come or time is up.
#pragma once

#include <chrono>
#include <span>
#include <vector>

#include "engine/engine.h"
#include "pending_request.h"
#include "refusal.h"
#include "wire/query_options.h"

namespace clearance {

struct HeldQuery {
  PendingRequest asked;
  QueryOptions query;
  std::vector<std::uint64_t> words;  ///< of the payload; the frame's own memory ends with its client's call
  std::uint64_t payload_bytes;
  std::chrono::steady_clock::time_point received, deadline;

  std::span<const std::byte> payload() const { return std::as_bytes(std::span(words)).first(payload_bytes); }
};

class HeldQueries {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether the poses that a query asks for are there. Throws a Refusal (kWrongScene) or a QueryError if what it waits
  /// for is not, or no more, in the scene.
  static bool poses_are_there(const Engine& engine, const wire::FrameHeader& request, const QueryOptions& query);

  bool empty() const { return held_.empty(); }
  std::size_t size() const { return held_.size(); }
  /// The first of theirs; of none: the end of time.
  Clock::time_point deadline() const { return deadline_; }

  /// Takes a query aside. Throws a Refusal (kPosesLate) if it does not want to wait, and if there is no room (kBusy).
  void hold(const wire::FrameHeader& request, const QueryOptions& query, std::span<const std::byte> payload,
            std::unique_ptr<ReplySink>& sink, Quotas& quotas, const Engine& engine, Clock::time_point received);
  /// Lets go of those whose poses are there, whose scene is another or whose time is up, in the order in which they
  /// came: `release(HeldQuery)`. Returns whether there were any.
  template <class Release>
  bool release(const Engine& engine, Clock::time_point now, Release release) {
    const std::size_t kept = part(engine, now);
    const bool any = held_.size() > kept;
    while (held_.size() > kept) {
      HeldQuery held = std::move(held_.back());
      held_.pop_back();
      release(std::move(held));
    }
    return any;
  }
  /// Lets go of those whose clients are gone. Returns how many these were.
  std::size_t drop_gone();

 private:
  std::size_t part(const Engine& engine, Clock::time_point now);

  std::vector<HeldQuery> held_;
  std::uint64_t looked_at_revision_ = 0;  // of the poses
  Clock::time_point deadline_ = Clock::time_point::max();
};

/// What is said when the poses are not there. \param waited in vain, or not at all.
Refusal poses_late(const QueryOptions& query, bool waited);

}  // namespace clearance
