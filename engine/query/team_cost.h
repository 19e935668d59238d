// Whether work is worth a team of OpenMP's threads.
//
// A team ends when its last thread does. Where other processes keep the cores busy, that thread may wait for a core for
// many milliseconds, spinning threads of the team make it wait longer, and libgomp reads its wait policy only once,
// when the process loads it. So work begins on the calling thread, and a team takes over what is left if that is more
// than teams have cost lately.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>

namespace clearance {

/// What a team has cost lately beyond the work of its threads. Thread-safe.
class TeamCost {
 public:
  using Clock = std::chrono::steady_clock;
  using Nanoseconds = std::chrono::nanoseconds;

  static constexpr Nanoseconds kLeast{100'000};          ///< on a quiet machine
  static constexpr Nanoseconds kFirst{500'000};          ///< until a team has been measured
  static constexpr Nanoseconds kHalving{1'000'000'000};  ///< as long without a team halves it

  /// Whether work that takes one thread `left_s` seconds is worth a team of `threads`.
  bool is_worth(double left_s, int threads, Clock::time_point now) const;
  /// \param took of a team, by the clock. \param worked of its threads, by the processors' clocks, in all
  void learn(Nanoseconds took, Nanoseconds worked, Clock::time_point now);
  void set(Nanoseconds cost, Clock::time_point now);

 private:
  Nanoseconds at(Clock::time_point now) const;

  mutable std::mutex mutex_;
  Nanoseconds cost_ = kFirst;
  Clock::time_point learned_ = Clock::now();
};

/// Of this process: its teams compete for the same cores.
TeamCost& team_cost();

/// How long the calling thread has run on a core.
std::chrono::nanoseconds thread_time();

}  // namespace clearance
