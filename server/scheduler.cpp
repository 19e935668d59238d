#include "scheduler.h"

namespace clearance {
namespace {

/// First slices given out before one of the long queries gets its turn.
constexpr int kFreshBeforeLong = 4;

}  // namespace

void Scheduler::add(QueryPtr query) {
  const std::uint64_t client = query->client();
  fresh_.push(client, std::move(query));
}

Scheduler::QueryPtr Scheduler::next() {
  const bool take_long = fresh_.empty() || (!long_.empty() && fresh_in_a_row_ >= kFreshBeforeLong);
  fresh_in_a_row_ = take_long ? 0 : fresh_in_a_row_ + 1;
  return take_long ? long_.pop() : fresh_.pop();
}

void Scheduler::work(Clock::time_point now, const Over& over) {
  const auto begin = now;
  while (!empty()) {
    QueryPtr query = next();
    const bool is_wanted = query->is_wanted();
    if (!is_wanted) query->let_go();
    if (!is_wanted || query->advance(slice_, now)) {
      over(std::move(query));
    } else {
      const std::uint64_t client = query->client();
      long_.push(client, std::move(query));
    }
    if (now - begin >= slice_) break;
  }
}

}  // namespace clearance
