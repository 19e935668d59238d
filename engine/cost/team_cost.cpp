#include "engine/cost/team_cost.h"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace clearance {

TeamCost::Nanoseconds TeamCost::at(Clock::time_point now) const {
  const double halvings = std::max(std::chrono::duration<double>(now - learned_) / kHalving, 0.0);
  return std::max(kLeast,
                  Nanoseconds(static_cast<std::int64_t>(static_cast<double>(cost_.count()) * std::exp2(-halvings))));
}

bool TeamCost::is_worth(double left_s, int threads, Clock::time_point now) const {
  const std::lock_guard lock(mutex_);
  return left_s * (1 - 1.0 / threads) > std::chrono::duration<double>(at(now)).count();
}

// Time beyond that of a single thread is a loss. A single loss may be chance and counts half, so that a shared machine
// does without teams only after several.
void TeamCost::learn(Nanoseconds took, Nanoseconds worked, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  cost_ = (at(now) + std::max(took - worked, Nanoseconds(0))) / 2;
  learned_ = now;
}

void TeamCost::set(Nanoseconds cost, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  cost_ = cost;
  learned_ = now;
}

TeamCost& team_cost() {
  static TeamCost& one = *new TeamCost();  // queries may outlast main()
  return one;
}

std::chrono::nanoseconds thread_time() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

}  // namespace clearance
