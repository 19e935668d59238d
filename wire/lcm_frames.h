// Frames of protocol.h in parts that fit one LCM message each, and whole again.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <optional>
#include <span>
#include <vector>

#include "aligned_buffer.h"
#include "clearance_lcm/frame_t.hpp"

namespace clearance {

/// A frame's bytes, from a 64-byte boundary.
struct FrameBytes {
  AlignedBytes bytes;
  std::uint64_t size = 0;

  FrameBytes() = default;
  /// Room for `n` bytes, not set. Throws std::bad_alloc.
  explicit FrameBytes(std::uint64_t n) : bytes(aligned_bytes(n)), size(n) {}
  std::span<const std::byte> span() const { return {bytes.get(), static_cast<std::size_t>(size)}; }
};

/// Parts that a frame of so many bytes takes; at least 1.
std::uint64_t frame_part_count(std::uint64_t frame_bytes,
                               std::uint64_t part_bytes = clearance_lcm::frame_t::PART_BYTES);

/// Part `part` of a frame; ids and sequence are the caller's to fill in.
clearance_lcm::frame_t frame_part(std::span<const std::byte> frame, std::uint64_t part);

/// Puts parts together, in whatever order they come. Only parts of one frame (sender and sequence) ever meet; a frame
/// of which a part is missing is given up when it is old, or when younger ones need the room.
class FrameAssembler {
 public:
  using Clock = std::chrono::steady_clock;
  struct Limits {
    std::uint64_t frame_bytes = 0;        ///< a larger frame is refused
    std::uint64_t total_bytes = 0;        ///< of all frames under way
    std::size_t frames = 64;              ///< under way
    std::chrono::milliseconds age{2000};  ///< since its last part
    std::uint64_t least_bytes = 64;       ///< a smaller frame is refused: a FrameHeader
    std::uint64_t part_bytes = clearance_lcm::frame_t::PART_BYTES;
  };
  struct Whole {
    std::int64_t server_id = 0;
    std::int64_t client_id = 0;
    std::int64_t request_id = 0;
    FrameBytes frame;
  };
  struct Counts {
    std::uint64_t bad = 0;       ///< parts whose numbers do not fit together, or of too large a frame
    std::uint64_t repeated = 0;  ///< parts that were there already
    std::uint64_t given_up = 0;  ///< frames
  };

  explicit FrameAssembler(const Limits& limits) : limits_(limits) {}

  /// Takes a part; the frame, if this was the last one missing.
  std::optional<Whole> add(const clearance_lcm::frame_t& part, Clock::time_point now);
  /// Gives up what is old.
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
