#include "server/core/workers.h"

#include <algorithm>
#include <utility>

namespace clearance {
namespace {

/// Niceness of workers that must not take CPUs from the loop and from the class control.
constexpr int kNiceOfPlanning = 10;

}  // namespace

Workers::Workers(const Options& options, bool has_control, const std::function<void()>& wake)
    : plans_({options.slice, options.worker_thread, kNiceOfPlanning}, wake),
      control_({options.slice, options.worker_thread}, wake),
      planning_({options.slice, options.worker_thread, has_control ? kNiceOfPlanning : 0}, wake),
      points_({options.slice, options.worker_thread, kNiceOfPlanning}, wake),
      runs_({options.slice, options.worker_thread}, wake) {}

Worker& Workers::of(RunsOn where, ServiceClass service) {
  switch (where) {
    case RunsOn::kPointWorker:
      return points_;
    case RunsOn::kPlanWorker:
      return plans_;
    case RunsOn::kRunWorker:
      return runs_;
    default:
      return of(service);
  }
}

void Workers::advance_on_loop(Worker::QueryPtr query) {
  if (query->advance_on_loop()) return;
  Worker& worker = of(query->service_class());
  worker.add(std::move(query));
}

bool Workers::advance_returned(Clock::time_point now) {
  bool any = false;
  for (Worker* worker : all_) {
    worker->expire(now);
    if (!worker->has_done()) continue;
    for (Worker::QueryPtr& query : worker->take()) advance_on_loop(std::move(query));
    any = true;
  }
  return any;
}

bool Workers::work() {
  return std::any_of(all_.begin(), all_.end(), [](Worker* worker) { return worker->work(); });
}

void Workers::check_clients() {
  for (Worker* worker : all_) worker->check_clients();
}

std::size_t Workers::size() const {
  std::size_t size = 0;
  for (const Worker* worker : all_) size += worker->size();
  return size;
}

}  // namespace clearance
