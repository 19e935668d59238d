// Counters of the C library's heaps.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "server/base/stats.h"

namespace clearance {

/// Bytes of all heaps, large blocks included. A heap that grows while `used` does not is kept by the allocator, and is no
/// leak. Used on the loop's thread.
class HeapCounters {
 public:
  struct Bytes {
    std::uint64_t used = 0, kept = 0;
  };

  /// Appends "heap.used_bytes" and "heap.kept_bytes", at most a second old, or nothing without the environment variable
  /// CLEARANCE_HEAP_COUNTERS, and where the allocator has no counters (sanitizers).
  void append_to(Stats::Named& counters);

 private:
  std::optional<Bytes> bytes_;
  std::optional<std::chrono::steady_clock::time_point> read_at_;
};

}  // namespace clearance
