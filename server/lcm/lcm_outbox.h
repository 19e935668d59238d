// What waits to be sent over LCM: paced, so that receivers keep up, and in turns, so that a long answer holds nobody
// up.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <optional>

#include "wire/lcm_bus.h"

namespace clearance {

class LcmOutbox {
 public:
  using Clock = std::chrono::steady_clock;
  /// What nobody waits for goes out slowly: the announcements of a large scene would fill small buffers every second.
  static constexpr double kAnnouncedBytesPerSecond = 8e6;

  explicit LcmOutbox(double bytes_per_second = LcmPacer::kBytesPerSecond) : pacer_(bytes_per_second) {}

  /// Sends part `i`; returns the bytes of its message, 0 if the system refused it.
  using SendPart = std::function<std::size_t(std::uint64_t i)>;
  /// Memory that may wait here.
  static constexpr std::uint64_t kMaxBytes = std::uint64_t{256} << 20;

  /// Appends `parts` messages that hold on to about `bytes` of memory. False (and nothing is sent) if there is no room.
  bool push(std::uint64_t parts, std::uint64_t bytes, SendPart send);
  /// Sends what may be sent now, one part of each in turn.
  void flush(Clock::time_point now);
  /// When flush() is due again; nothing if nothing waits.
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
