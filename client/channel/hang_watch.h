// Detects a daemon whose loop stands still while a call waits for an answer.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "client/channel/channel.h"

namespace clearance {

/// Samples a channel's signs of life a few times within the patience, while a call waits. Counts samples instead of
/// time, so that a process that was itself suspended, alone or with the daemon, does not report a hung daemon.
class HangWatch {
 public:
  /// \param patience zero disables the watch
  explicit HangWatch(std::chrono::nanoseconds patience) : step_(patience / kLooks) {}

  /// Returns the time of the next sample, or the maximum time if disabled.
  Deadline due() const { return step_.count() > 0 ? due_ : Deadline::max(); }
  /// Takes a sample, not before due(). Returns whether the daemon has shown no sign of life in all samples.
  bool look(Channel& channel, Deadline now) {
    const bool is_late = now - due_ > std::max(step_, kSlack);  // no call was waiting, or this process did not run
    due_ = now + step_;
    if (is_late || now < quiet_until_) return false;
    const std::uint64_t sign = channel.sign_of_life();
    if (sign == 0 || sign != last_)
      still_ = 0;
    else
      ++still_;
    last_ = sign;
    return still_ >= kLooks;
  }
  /// Postpones samples for a frame of so many bytes on a channel where it delays the signs of life behind it.
  void expect(std::uint64_t bytes) {
    if (bytes < kLarge) return;
    quiet_until_ = std::max(quiet_until_, Deadline::clock::now()) + std::chrono::nanoseconds(bytes * kNsPerByte);
  }

 private:
  static constexpr int kLooks = 8;
  static constexpr std::chrono::nanoseconds kSlack = std::chrono::milliseconds(100);
  static constexpr std::uint64_t kLarge = 1 << 20;
  static constexpr std::uint64_t kNsPerByte = 100;  // 10 MB/s, for a network of 100 Mbit/s

  std::chrono::nanoseconds step_;
  Deadline due_{}, quiet_until_{};
  std::uint64_t last_ = 0;
  int still_ = 0;
};

}  // namespace clearance
