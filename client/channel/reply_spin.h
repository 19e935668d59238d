// Choice of the time for which a client spins before it sleeps, from the durations of earlier requests.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>

#include "wire/spin_gate.h"

namespace clearance {

/// A wake-up costs about 13 us, so a wait should outlast the reply. Requests of one size are usually one query with other
/// numbers, so their durations predict the next one. A longer spin than the base time stops as soon as another thread
/// needed the core. Not thread-safe.
class ReplySpin {
 public:
  using Duration = std::chrono::nanoseconds;
  static constexpr Duration kLongest = std::chrono::microseconds(400);  ///< requests expected to take longer sleep
  static constexpr unsigned kPause = 256;  ///< waits without long spins after another thread needed the core

  /// \param base spin time without knowledge of the request; 0 to never spin
  explicit ReplySpin(Duration base) : base_(base) {}

  /// Spin time of the next wait for a reply to a request of this size, or 0.
  Duration next(std::uint64_t request_bytes) {
    if (base_ <= Duration::zero()) return Duration::zero();
    const Duration expected = expected_[slot(request_bytes)];
    if (expected > base_ && expected <= kLongest && (pause_ == 0 || --pause_ == 0) && long_.opens())
      return expected + expected / 2 + base_;
    return short_.opens() ? base_ : Duration::zero();
  }
  bool is_long(Duration spin) const { return spin > base_; }

  /// Records a spin of next() and whether the reply came in time.
  void spun(Duration spin, bool paid) {
    SpinGate& gate = is_long(spin) ? long_ : short_;
    paid ? gate.paid() : gate.missed();
  }
  /// Records that another thread ran on the core during a long spin.
  void preempted() { pause_ = kPause; }
  /// Records the duration of a wait for a reply.
  void replied(std::uint64_t request_bytes, Duration took) {
    Duration& expected = expected_[slot(request_bytes)];
    expected = expected == Duration::zero() ? took : expected + (took - expected) / 4;
  }

 private:
  static std::size_t slot(std::uint64_t request_bytes) {
    return (request_bytes * 0x9e3779b97f4a7c15u) >> 58;  // of 64; a collision only mispredicts
  }

  Duration base_;
  std::array<Duration, 64> expected_{};
  SpinGate short_, long_;
  unsigned pause_ = 0;
};

}  // namespace clearance
