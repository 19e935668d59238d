#include "server/tasks/scheduler.h"

namespace clearance {
namespace {

/// First slices before a query that needs more slices gets one.
constexpr int kFreshBeforeLong = 4;
/// Slices of the class control before the class planning gets one.
constexpr int kControlBeforePlanning = 64;

}  // namespace

void Scheduler::add(QueryPtr query) {
  const std::uint64_t client = query->client();
  of(query->service_class()).fresh.push(client, std::move(query));
}

Scheduler::QueryPtr Scheduler::Queues::next() {
  const bool take_begun = fresh.empty() || (!begun.empty() && fresh_in_a_row >= kFreshBeforeLong);
  fresh_in_a_row = take_begun ? 0 : fresh_in_a_row + 1;
  return take_begun ? begun.pop() : fresh.pop();
}

Scheduler::QueryPtr Scheduler::next() {
  const bool take_planning = control_.empty() || (!planning_.empty() && control_in_a_row_ >= kControlBeforePlanning);
  control_in_a_row_ = take_planning ? 0 : control_in_a_row_ + 1;
  return take_planning ? planning_.next() : control_.next();
}

void Scheduler::work(Clock::time_point now, const Over& over) {
  const auto begin = now;
  while (!empty()) {
    QueryPtr query = next();
    const bool is_wanted = query->is_wanted();
    if (!is_wanted) query->free_memory();
    if (!is_wanted || query->advance(slice_, now)) {
      over(std::move(query));
    } else {
      const std::uint64_t client = query->client();
      of(query->service_class()).begun.push(client, std::move(query));
    }
    if (now - begin >= slice_) break;
  }
}

}  // namespace clearance
