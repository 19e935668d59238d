// Requests and their handlers. request_router.cpp has the table of request types.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <vector>

#include "server/core/heap_counters.h"
#include "server/core/plan_requests.h"
#include "server/core/query_requests.h"
#include "server/core/request_context.h"
#include "server/core/scene_changes.h"
#include "server/core/state_updates.h"

namespace clearance {

/// Used on the loop's thread.
class RequestRouter {
 public:
  struct Limits : Quotas::Limits, SceneChanges::Limits, QueryLimits, PointLimits, PlanLimits {
    bool require_epoch = false;  ///< reject requests that deal with poses and name no epoch (kNewEpoch)
  };

  /// @param limits outlive this
  /// @param slice of queries on the loop
  RequestRouter(std::shared_ptr<engine::Engine> engine, Workers& workers, const Limits& limits,
                std::chrono::nanoseconds slice);

  /// Answers a request, or passes it on to a worker.
  void route(Request request);
  /// Drops requests whose clients are gone.
  void drop_gone();
  /// Queries under way.
  std::size_t waiting() const { return queries.small() + context.workers.size(); }
  Stats::Named counters();
  std::size_t bodies() const { return context.engine->scene().bodies().size(); }
  std::size_t joints() const { return context.engine->scene().joints().size(); }

  // Handlers of the simple requests.
  void ping(Request& request);
  /// Sends a payload, which a worker makes if it has more than kFewBodies elements.
  void send(Request& request, std::size_t size, std::vector<std::byte> (*payload)(const engine::Engine&));
  void send_stats(Request& request);

  RequestContext context;
  QueryRequests queries;
  StateUpdates updates;
  PlanRequests plans;
  SceneChanges scenes;

 private:
  void dispatch(Request& request);

  const std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  HeapCounters heaps_;
};

}  // namespace clearance
