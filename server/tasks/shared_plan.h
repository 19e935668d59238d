// A plan whose poses a client writes and whose rows it reads where they are: in a device's memory that both map.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

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

/// Made, run and freed on threads that nobody waits for: the device is asked for memory, and awaited.
class SharedPlan {
 public:
  /// Throws a Refusal or a QueryError. \param engine is kept: with its scene. \param query without configurations, but
  /// for how many they are
  SharedPlan(std::shared_ptr<const Engine> engine, const QueryView& query, const QueryLimits& limits, PlanShare share);
  SharedPlan(const SharedPlan&) = delete;
  SharedPlan& operator=(const SharedPlan&) = delete;

  /// The payload of kPlan. \param number the plan's
  std::vector<std::byte> description(std::uint64_t number) const;

  /// A run goes on until advance() has returned true. Both throw a Refusal or a QueryError; then it is over.
  void begin_run();
  /// Launches what is left and looks whether rows are there, for `budget` at most or, where it takes long anyway, a
  /// nap.
  bool advance(std::chrono::nanoseconds budget);
  /// Of the run that was over last.
  std::chrono::nanoseconds took() const { return took_; }

 private:
  using Clock = std::chrono::steady_clock;

  std::byte* at(std::uint64_t offset) const { return memory_->data() + offset; }
  void launch_some();

  std::shared_ptr<const Engine> engine_;
  PlanShare share_;
  std::unique_ptr<DevicePlan> plan_;
  std::unique_ptr<cuda::SharedMemory> memory_;  // the first to go: it waits for what runs in its stream
  std::uint32_t bodies_ = 0, joints_ = 0;
  std::uint64_t positions_offset_ = 0, columns_offset_ = 0;
  std::uint64_t next_ = 0;  // configuration that the run launches next
  Clock::time_point begun_;
  std::chrono::nanoseconds took_{0};
};

}  // namespace clearance
