#include "bench/latency/bench_samples.h"

#include <time.h>

#include <cerrno>

namespace clearance::cli {

void wait_until(std::chrono::steady_clock::time_point when) {
  // A sleeping thread wakes up late by the timer's slack and the scheduler's latency, so the last part is spun.
  constexpr auto kSpun = std::chrono::microseconds(150);
  const auto wake = (when - kSpun).time_since_epoch();
  if (when - kSpun > std::chrono::steady_clock::now()) {
    const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(wake).count();
    const timespec until{ns / 1'000'000'000, ns % 1'000'000'000};
    while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
    }
  }
  while (std::chrono::steady_clock::now() < when) {
  }
}

}  // namespace clearance::cli
