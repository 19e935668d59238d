// A plan in memory of a device that client and daemon map: the client writes poses and reads rows in place.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine/device/query/device_layout.h"
#include "engine/device/query/device_plan.h"
#include "engine/device/shared_memory.h"
#include "engine/engine.h"
#include "server/limits/resource_quota.h"
#include "server/tasks/query_input.h"

namespace clearance {

/// Held by one plan: one of the open plans, and bytes of the device's memory.
struct PlanShare {
  ResourceQuota::Share plan, bytes;
};

/// Made, run and freed on workers of its own, as it waits for the device.
class SharedPlan {
 public:
  /// Throws RejectedRequest or QueryError.
  /// @param engine kept with its scene
  /// @param query without configurations except their number
  SharedPlan(std::shared_ptr<const engine::Engine> engine, const QueryView& query, const QueryLimits& limits,
             PlanShare share);
  SharedPlan(const SharedPlan&) = delete;
  SharedPlan& operator=(const SharedPlan&) = delete;

  /// Returns the payload of kPlan.
  /// @param number of the plan
  std::vector<std::byte> description(std::uint64_t number) const;

  /// Begins a run, which goes on until advance() returns true or either throws (RejectedRequest, QueryError).
  void begin_run();
  /// Launches further chunks and polls for rows, for `budget` at most, or a nap in a long run.
  bool advance(std::chrono::nanoseconds budget);
  /// Duration of the last run.
  std::chrono::nanoseconds took() const { return took_; }

 private:
  using Clock = std::chrono::steady_clock;

  void launch_some();

  std::shared_ptr<const engine::Engine> engine_;
  PlanShare share_;
  DeviceLayout layout_;
  std::unique_ptr<DevicePlan> plan_;
  std::unique_ptr<cuda::SharedMemory> memory_;  // destroyed first, as it waits for its stream
  std::uint64_t next_ = 0;                      // next configuration to launch
  Clock::time_point begun_;
  std::chrono::nanoseconds took_{0};
};

}  // namespace clearance
