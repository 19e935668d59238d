// Requests for plans in a device's memory, which are made, run and freed on workers of their own.
#pragma once

#include "server/core/request_context.h"
#include "server/tasks/device_plans.h"

namespace clearance {

/// Used on the loop's thread.
class PlanRequests {
 public:
  /// @param query_limits outlive this
  PlanRequests(RequestContext& context, const DevicePlans::Limits& limits, const QueryLimits& query_limits)
      : context_(context), query_limits_(query_limits), plans_(limits) {}

  void open(Request& request);
  void run(Request& request);
  void close(Request& request);
  /// Closes the plans of clients that are gone.
  void drop_gone() { count_closed(plans_.drop_gone()); }
  void clear() { plans_.clear(); }
  const DevicePlans& plans() const { return plans_; }

 private:
  void count_closed(std::size_t plans) { context_.stats["plans.closed"] += plans; }

  RequestContext& context_;
  const QueryLimits& query_limits_;
  DevicePlans plans_;
};

}  // namespace clearance
