// Notices a daemon whose loop stands still while somebody waits for an answer.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "client/channel.h"

namespace clearance {

/// Looks at a channel's signs of life a few times within the patience, as long as somebody waits. It counts looks and
/// not time: a process that was itself held up, or suspended together with the daemon, takes nobody for dead.
class HangWatch {
 public:
  /// \param patience zero: never.
  explicit HangWatch(std::chrono::nanoseconds patience) : step_(patience / kLooks) {}

  /// When to look next; the end of time if there is nothing to look for.
  Deadline due() const { return step_.count() > 0 ? due_ : Deadline::max(); }
  /// Whether the daemon has shown no sign of life in so many looks. Not before due().
  bool look(Channel& channel, Deadline now) {
    const bool is_late = now - due_ > std::max(step_, kSlack);  // nobody waited meanwhile, or we did not run
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
  /// Frames of so many bytes are on their way over a channel that shows whole frames alone: signs of life queue up
  /// behind them.
  void expect(std::uint64_t bytes) {
    if (bytes < kLarge) return;
    quiet_until_ = std::max(quiet_until_, Deadline::clock::now()) + std::chrono::nanoseconds(bytes * kNsPerByte);
  }

 private:
  static constexpr int kLooks = 8;
  static constexpr std::chrono::nanoseconds kSlack = std::chrono::milliseconds(100);
  static constexpr std::uint64_t kLarge = 1 << 20;
  static constexpr std::uint64_t kNsPerByte = 100;  // 10 MB/s, what a network of 100 Mbit/s takes

  std::chrono::nanoseconds step_;
  Deadline due_{}, quiet_until_{};
  std::uint64_t last_ = 0;
  int still_ = 0;
};

}  // namespace clearance
