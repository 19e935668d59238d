// The daemon's five workers. Each has a thread of its own, because not all work can be cut into slices.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>

#include "server/core/request.h"
#include "server/tasks/worker.h"

namespace clearance {

/// Used from the loop's thread. The workers of the two classes answer queries. Trees of points, plans on a device and
/// waits for a device would block them, and have workers of their own.
class Workers {
 public:
  using Clock = ScheduledQuery::Clock;
  struct Options {
    std::chrono::nanoseconds slice = std::chrono::microseconds(200);  ///< of one query, before the others get a turn
    bool worker_thread = true;  ///< if false the loop does all work itself, so that a test can count slices
  };

  /// @param has_control clients may have the class control, whose worker then has the higher priority
  /// @param wake called on a worker's thread when advance_returned() has something to do
  Workers(const Options& options, bool has_control, const std::function<void()>& wake);

  Worker& of(ServiceClass service) { return service == ServiceClass::kControl ? control_ : planning_; }
  Worker& of(RunsOn where, ServiceClass service);
  /// Does the loop's part of a query, and passes it on to a worker unless it is over.
  void advance_on_loop(Worker::QueryPtr query);
  /// Does that for all queries that workers have returned, and rejects those whose deadline has passed. Returns whether
  /// any was returned.
  bool advance_returned(Clock::time_point now);
  /// Does a slice of work without threads. Returns whether there was any.
  bool work();
  /// Checks whether the clients are still connected.
  void check_clients();
  Clock::time_point deadline() const { return std::min(control_.deadline(), planning_.deadline()); }
  std::size_t size() const;
  /// Frees what takes long to free. From any thread.
  void drop(std::shared_ptr<void> thing) { planning_.drop(std::move(thing)); }
  void drop_plan(std::shared_ptr<void> plan) { plans_.drop(std::move(plan)); }

 private:
  // plans_ ends last, as the other workers' requests may drop plans, which it frees.
  Worker plans_, control_, planning_, points_, runs_;
  const std::array<Worker*, 5> all_{&control_, &planning_, &points_, &plans_, &runs_};
};

}  // namespace clearance
