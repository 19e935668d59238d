// Queries that wait for poses (QueryOptions::min_pose_stamp_ns). They are checked when poses arrive, and block no other
// query.
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
  PendingRequest pending;
  ServiceClass service;
  QueryOptions query;
  OwnPayload payload;
  std::chrono::steady_clock::time_point received, deadline;
};

class DeferredQueries {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether the poses that a query waits for have arrived. Throws RejectedRequest (kWrongScene) or QueryError if the
  /// body that it waits for is not, or no more, in the scene.
  static bool poses_are_there(const engine::Engine& engine, const wire::FrameHeader& request,
                              const QueryOptions& query);

  bool empty() const { return held_.empty() && over_.empty(); }
  std::size_t size() const { return held_.size() + over_.size(); }
  /// No later than the first deadline.
  Clock::time_point deadline() const { return deadline_; }

  /// Defers a query until its poses are there or its deadline. Throws RejectedRequest beyond a limit (kBusy).
  void hold(const wire::FrameHeader& request, ServiceClass service, const QueryOptions& query, OwnPayload payload,
            std::unique_ptr<ReplySink>& sink, Quotas& quotas, const engine::Engine& engine, Clock::time_point received);
  /// Releases a few of the queries whose poses have arrived, whose scene is another or whose time is up, in the order
  /// of their arrival, by `release(DeferredQuery)`. Returns whether there were any.
  template <class Release>
  bool release(const engine::Engine& engine, Clock::time_point now, Release release) {
    part(engine, now);
    const bool any = !over_.empty();
    for (int i = 0; i < kReleasedAtATime && !over_.empty(); ++i) {
      DeferredQuery held = std::move(over_.front());
      over_.pop_front();
      release(std::move(held));
    }
    return any;
  }
  /// Drops those whose clients are gone, and returns their number.
  std::size_t drop_gone();

 private:
  static constexpr int kReleasedAtATime = 16;
  void part(const engine::Engine& engine, Clock::time_point now);

  std::vector<DeferredQuery> held_;
  std::deque<DeferredQuery> over_;        // whose wait is over
  std::uint64_t looked_at_revision_ = 0;  // of the poses
  Clock::time_point deadline_ = Clock::time_point::max();
};

/// Rejection of a query whose poses have not come in time.
RejectedRequest poses_late(const QueryOptions& query);

}  // namespace clearance
