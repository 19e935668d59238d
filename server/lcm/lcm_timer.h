// A descriptor that becomes readable at a given time.
#pragma once

#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>

#include "wire/shm_os.h"

namespace clearance {

class LcmTimer {
 public:
  using Clock = std::chrono::steady_clock;

  /// Throws std::runtime_error.
  LcmTimer() : fd_(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)) {
    if (!fd_) throw std::runtime_error(std::string("LCM: no timer: ") + std::strerror(errno));
  }
  int get() const { return fd_.get(); }
  /// Makes the descriptor unreadable again.
  void clear() {
    if (!armed_) return;
    std::uint64_t expirations = 0;
    [[maybe_unused]] const auto ignored = ::read(fd_.get(), &expirations, sizeof expirations);
  }
  /// @param due or nothing to disarm the timer
  void arm(std::optional<Clock::time_point> due) {
    if (!due && !armed_) return;
    armed_ = due.has_value();
    itimerspec spec{};
    if (due) {
      const auto wait = std::max(*due - Clock::now(), Clock::duration(std::chrono::microseconds(50)));
      spec.it_value.tv_sec = std::chrono::duration_cast<std::chrono::seconds>(wait).count();
      spec.it_value.tv_nsec = (wait % std::chrono::seconds(1)).count();
    }
    ::timerfd_settime(fd_.get(), 0, &spec, nullptr);
  }

 private:
  shm::UniqueFd fd_;
  bool armed_ = false;
};

}  // namespace clearance
