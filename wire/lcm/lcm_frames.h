// Splits frames of protocol.h into parts for LCM messages, and joins them.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <optional>
#include <span>
#include <vector>

#include "clearance_lcm/frame_t.hpp"
#include "wire/aligned_buffer.h"

namespace clearance {

/// A frame's bytes, aligned to 64 bytes.
struct FrameBytes {
  AlignedBytes bytes;
  std::uint64_t size = 0;

  FrameBytes() = default;
  /// Allocates `n` uninitialised bytes. Throws std::bad_alloc.
  explicit FrameBytes(std::uint64_t n) : bytes(aligned_bytes(n)), size(n) {}
  std::span<const std::byte> span() const { return {bytes.get(), static_cast<std::size_t>(size)}; }
};

/// Number of parts of a frame of so many bytes, at least 1.
std::uint64_t frame_part_count(std::uint64_t frame_bytes,
                               std::uint64_t part_bytes = clearance_lcm::frame_t::PART_BYTES);

/// Returns part `part` of a frame, without ids and sequence, which the caller sets.
clearance_lcm::frame_t frame_part(std::span<const std::byte> frame, std::uint64_t part);

/// Joins parts in any order, by sender and sequence. An incomplete frame is dropped when it is too old, or to make
/// space for newer ones.
class FrameAssembler {
 public:
  using Clock = std::chrono::steady_clock;
  struct Limits {
    std::uint64_t frame_bytes = 0;        ///< maximum size of a frame
    std::uint64_t total_bytes = 0;        ///< maximum size of all incomplete frames
    std::size_t frames = 64;              ///< maximum number of incomplete frames
    std::chrono::milliseconds age{2000};  ///< maximum age of an incomplete frame, since its last part
    std::uint64_t least_bytes = 64;       ///< minimum size of a frame: a FrameHeader
    std::uint64_t part_bytes = clearance_lcm::frame_t::PART_BYTES;
  };
  struct Whole {
    std::int64_t server_id = 0;
    std::int64_t client_id = 0;
    std::int64_t request_id = 0;
    FrameBytes frame;
  };
  struct Counts {
    std::uint64_t bad = 0;       ///< parts with inconsistent numbers, or of too large a frame
    std::uint64_t repeated = 0;  ///< duplicate parts
    std::uint64_t given_up = 0;  ///< dropped frames
  };

  explicit FrameAssembler(const Limits& limits) : limits_(limits) {}

  /// Adds a part; returns the frame if it is complete.
  std::optional<Whole> add(const clearance_lcm::frame_t& part, Clock::time_point now);
  /// Drops incomplete frames that are too old.
  void expire(Clock::time_point now);
  const Counts& counts() const { return counts_; }

 private:
  struct Partial {
    Whole whole;
    std::int64_t sequence = 0;
    std::vector<bool> there;
    std::uint64_t missing = 0;
    Clock::time_point last;
  };
  void give_up(std::list<Partial>::iterator partial);

  Limits limits_;
  std::list<Partial> partials_;  // oldest first by their last part
  std::uint64_t bytes_ = 0;
  Counts counts_;
};

}  // namespace clearance
