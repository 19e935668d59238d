// Messages waiting to be sent over LCM: paced, so that receivers keep up, and interleaved, so that a long reply delays
// no other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <optional>

#include "wire/lcm/lcm_bus.h"

namespace clearance {

class LcmOutbox {
 public:
  using Clock = std::chrono::steady_clock;
  /// Rate of announcements, low so that those of a large scene do not fill small buffers every second.
  static constexpr double kAnnouncedBytesPerSecond = 8e6;

  explicit LcmOutbox(double bytes_per_second = LcmPacer::kBytesPerSecond) : pacer_(bytes_per_second) {}

  /// Sends part `i`. Returns the bytes of its message, or 0 after an error.
  using SendPart = std::function<std::size_t(std::uint64_t i)>;
  /// Limit of memory for waiting messages.
  static constexpr std::uint64_t kMaxBytes = std::uint64_t{256} << 20;

  /// Queues `parts` messages that hold about `bytes` of memory. Returns false, and sends nothing, beyond the limit.
  bool push(std::uint64_t parts, std::uint64_t bytes, SendPart send);
  /// Sends as much as may be sent now, one part of each message in turn.
  void flush(Clock::time_point now);
  /// Time of the next flush(), or nothing if no message waits.
  std::optional<Clock::time_point> due() const;

  std::uint64_t sent() const { return sent_; }
  std::uint64_t failed() const { return failed_; }

 private:
  struct Item {
    std::uint64_t parts, next, bytes;
    SendPart send;
  };
  std::list<Item> items_;
  std::uint64_t bytes_ = 0;
  std::uint64_t sent_ = 0, failed_ = 0;
  LcmPacer pacer_;
  Clock::time_point due_{};
};

}  // namespace clearance
