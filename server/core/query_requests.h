// Requests for distances: small queries begin on the loop, others on a worker, and some wait for poses first.
#pragma once

#include <chrono>
#include <memory>
#include <vector>

#include "server/core/request_context.h"
#include "server/limits/forecast.h"
#include "server/tasks/client_queries.h"
#include "server/tasks/deferred_queries.h"
#include "server/tasks/query_task.h"
#include "server/tasks/scheduler.h"

namespace clearance {

/// Used on the loop's thread.
class QueryRequests {
 public:
  using Clock = ScheduledQuery::Clock;

  /// @param limits outlive this
  /// @param slice of the small queries, which the loop works on
  QueryRequests(RequestContext& context, const QueryLimits& limits, std::chrono::nanoseconds slice);

  void start(Request& request);
  /// Works on small queries for about a slice. Returns whether there were any.
  bool work();
  std::size_t small() const { return small_.size(); }
  const DeferredQueries& deferred() const { return deferred_; }
  /// Begins deferred queries whose poses have arrived or whose time is up. Returns whether there were any.
  bool begin_deferred(Clock::time_point now);
  /// Drops deferred and kept queries of clients that are gone.
  void drop_gone();

 private:
  bool is_small(const QueryCost& cost, const QueryOptions& options) const;
  bool defer(const wire::FrameHeader& header, ServiceClass service, const QueryOptions& options,
             const OwnPayload& payload, std::unique_ptr<ReplySink>& sink, Clock::time_point received);
  void begin_one_deferred(DeferredQuery query);
  void begin(Request& request, const ClientQuery& query);
  void begin_on_worker(std::unique_ptr<QueryTask> query, Request& request, const QueryCost& cost);
  std::unique_ptr<QueryTask> new_query(const Request& request, ServiceClass service, Clock::time_point due) const;

  RequestContext& context_;
  Forecast forecast_;
  Scheduler small_;
  DeferredQueries deferred_;
  ClientQueries clients_;
  std::vector<std::uint64_t> aligned_;  // copy of a payload that arrived unaligned
  QueryTask::Daemon daemon_;
};

}  // namespace clearance
