// Waits for replies in a shared segment: spins for as long as pays, then sleeps.
#pragma once

#include <chrono>
#include <cstdint>

#include "client/channel/channel.h"
#include "client/channel/reply_spin.h"
#include "client/channel/shm_client_segment.h"

namespace clearance {

/// Not thread-safe.
class ReplyWait {
 public:
  /// \param spin spin time without knowledge of the request; 0 to never spin
  explicit ReplyWait(std::chrono::nanoseconds spin);

  /// Waits for a new entry in `segment`, at most until the deadline or for 10 ms. Returns true if it slept and no
  /// entry came; the daemon may be gone.
  /// \param request_bytes size of the request that waits, which predicts the time
  bool wait(ClientSegment& segment, std::uint64_t request_bytes, Deadline deadline);
  /// Reads the clock for the next wait.
  Deadline look();
  /// The last reading of the clock.
  Deadline last_look() const { return last_look_; }
  /// Records that a request was replied to since its first wait began.
  void replied(std::uint64_t request_bytes, Deadline began) { spins_.replied(request_bytes, last_look_ - began); }

 private:
  bool spin_until(ClientSegment& segment, Deadline end);
  bool spin_long(ClientSegment& segment, Deadline end);

  ReplySpin spins_;
  Deadline last_look_{};
};

}  // namespace clearance
