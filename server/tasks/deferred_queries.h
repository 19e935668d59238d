// Queries that wait for poses (QueryOptions::min_pose_stamp_ns): held aside, so that they hold nobody up, and looked at
// when poses have come or time is up.
#pragma once

#include <chrono>
#include <deque>
#include <span>
#include <vector>

#include "engine/engine.h"
#include "server/base/rejected_request.h"
#include "server/requests/pending_request.h"
#include "wire/query_options.h"

namespace clearance {

struct DeferredQuery {
  PendingRequest asked;
  ServiceClass service;
  QueryOptions query;
  OwnPayload payload;
  std::chrono::steady_clock::time_point received, deadline;
};

class DeferredQueries {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether the poses that a query asks for are there. Throws a Refusal (kWrongScene) or a QueryError if what it waits
  /// for is not, or no more, in the scene.
  static bool poses_are_there(const Engine& engine, const wire::FrameHeader& request, const QueryOptions& query);

  bool empty() const { return held_.empty() && over_.empty(); }
  std::size_t size() const { return held_.size() + over_.size(); }
  /// The first of theirs; of none: the end of time.
  Clock::time_point deadline() const { return deadline_; }

  /// Takes a query aside. Throws a Refusal (kPosesLate) if it does not want to wait, and if there is no room (kBusy).
  void hold(const wire::FrameHeader& request, ServiceClass service, const QueryOptions& query, OwnPayload payload,
            std::unique_ptr<ReplySink>& sink, Quotas& quotas, const Engine& engine, Clock::time_point received);
  /// Lets go of those whose poses are there, whose scene is another or whose time is up, in the order in which they
  /// came and a few at a time: `release(DeferredQuery)`. Returns whether there were any.
  template <class Release>
  bool release(const Engine& engine, Clock::time_point now, Release release) {
    part(engine, now);
    const bool any = !over_.empty();
    for (int i = 0; i < kReleasedAtATime && !over_.empty(); ++i) {
      DeferredQuery held = std::move(over_.front());
      over_.pop_front();
      release(std::move(held));
    }
    return any;
  }
  /// Lets go of those whose clients are gone. Returns how many these were.
  std::size_t drop_gone();

 private:
  static constexpr int kReleasedAtATime = 16;
  void part(const Engine& engine, Clock::time_point now);

  std::vector<DeferredQuery> held_;
  std::deque<DeferredQuery> over_;        // that need not wait any longer
  std::uint64_t looked_at_revision_ = 0;  // of the poses
  Clock::time_point deadline_ = Clock::time_point::max();
};

/// What is said when the poses are not there. \param waited in vain, perhaps to the query's deadline, or not at all.
RejectedRequest poses_late(const QueryOptions& query, bool waited);

}  // namespace clearance
