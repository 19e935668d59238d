// Decides whether work is worth a team of threads (helping_threads.h).
//
// To wake threads takes calls of the system. If other processes keep the cores busy, a thread that has begun a unit may
// lose its core for many milliseconds, and the team ends with it. So work begins on the calling thread, and a team takes
// over the rest if that is more than teams have cost lately.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>

namespace clearance {

/// Recent cost of a team beyond the work of its threads. Thread-safe.
class TeamCost {
 public:
  using Clock = std::chrono::steady_clock;
  using Nanoseconds = std::chrono::nanoseconds;

  static constexpr Nanoseconds kLeast{100'000};          ///< on a quiet machine
  static constexpr Nanoseconds kFirst{500'000};          ///< until a team has been measured
  static constexpr Nanoseconds kHalving{1'000'000'000};  ///< time without a team that halves the cost

  /// Whether work that takes one thread `left_s` seconds is worth a team of `threads`.
  bool is_worth(double left_s, int threads, Clock::time_point now) const;
  /// \param took of a team, by the clock
  /// \param worked of all its threads, by processor time
  void learn(Nanoseconds took, Nanoseconds worked, Clock::time_point now);
  void set(Nanoseconds cost, Clock::time_point now);

 private:
  Nanoseconds at(Clock::time_point now) const;

  mutable std::mutex mutex_;
  Nanoseconds cost_ = kFirst;
  Clock::time_point learned_ = Clock::now();
};

/// The cost in this process, whose teams compete for the same cores.
TeamCost& team_cost();

/// Processor time of the calling thread.
std::chrono::nanoseconds thread_time();

}  // namespace clearance
