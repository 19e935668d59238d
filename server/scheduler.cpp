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

std::size_t Scheduler::work(Clock::time_point now) {
  if (empty()) return 0;
  const auto begin = now;
  std::size_t dropped = 0;
  do {
    QueryPtr query = next();
    if (!query->is_wanted()) {
      ++dropped;
    } else if (!query->advance(slice_, now)) {
      const std::uint64_t client = query->client();
      long_.push(client, std::move(query));
    }
  } while (!empty() && now - begin < slice_);
  return dropped;
}

std::size_t Scheduler::drop_unwanted() {
  const std::size_t before = size();
  const auto unwanted = [](const QueryPtr& query) { return !query->is_wanted(); };
  fresh_.remove_if(unwanted);
  long_.remove_if(unwanted);
  return before - size();
}

}  // namespace clearance
