// Requests for plans in a device's memory, which are made, run and freed on workers of their own.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>

#include "server/core/request_context.h"
#include "server/limits/resource_quota.h"
#include "server/tasks/query_input.h"
#include "server/tasks/shared_plan.h"

namespace clearance {

struct PlanLimits {
  std::uint32_t max_plans_of_client = 8;                            ///< 0 if no plans may be opened
  std::uint32_t max_plans = 64;                                     ///< of all clients
  std::uint64_t max_plan_bytes_of_client = std::uint64_t{2} << 30;  ///< kTooLarge beyond it
  std::uint64_t max_plan_bytes = std::uint64_t{8} << 30;            ///< of all clients, kBusy beyond it
};

/// Used on the loop's thread.
class PlanRequests {
 public:
  /// @param query_limits outlive this
  PlanRequests(RequestContext& context, const PlanLimits& limits, const QueryLimits& query_limits);

  void open(Request& request);
  void run(Request& request);
  /// A run under way ends before the plan's memory is freed.
  void close(Request& request);
  /// Closes the plans of clients that are gone.
  void drop_gone();
  void clear() { plans_.clear(); }
  std::uint64_t count() const { return count_.total(); }
  std::uint64_t bytes() const { return bytes_.total(); }

 private:
  struct Plan {
    std::uint64_t client = 0;
    std::function<bool()> is_there;  // ReplySink::watch()
    std::shared_ptr<SharedPlan> plan;
    bool is_running = false;
  };
  using Plans = std::map<std::uint64_t, Plan>;

  PlanShare take_share(std::uint64_t client);
  Plans::iterator find(const Request& request);

  RequestContext& context_;
  const QueryLimits& query_limits_;
  const bool is_allowed_;
  ResourceQuota count_, bytes_;  // shares are released on a worker
  Plans plans_;                  // by number
  std::uint64_t last_number_ = 0;
};

}  // namespace clearance
