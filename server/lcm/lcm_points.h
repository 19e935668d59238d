// Assembles point clouds from LCM messages.
#pragma once

#include <cstdint>
#include <optional>

#include "clearance_lcm/points_t.hpp"
#include "wire/lcm/lcm_frames.h"

namespace clearance {

/// Joins a cloud's parts into one frame (kSetPoints), in bounded memory (FrameAssembler).
class LcmPoints {
 public:
  using Clock = FrameAssembler::Clock;
  static constexpr std::uint64_t kMostPoints = 2'000'000;  ///< of one cloud

  /// Adds a part. Returns the frame if it was the last one missing.
  /// @param body id of the body that the part names
  std::optional<FrameBytes> add(const clearance_lcm::points_t& part, std::uint32_t body, Clock::time_point now);
  void expire(Clock::time_point now) { parts_.expire(now); }
  const FrameAssembler::Counts& counts() const { return parts_.counts(); }

 private:
  static constexpr std::uint64_t kPointBytes = 12;
  FrameAssembler parts_{{.frame_bytes = kMostPoints * kPointBytes,
                         .total_bytes = 4 * kMostPoints * kPointBytes,
                         .frames = 64,
                         .least_bytes = 0,
                         .part_bytes = clearance_lcm::points_t::PART_POINTS * kPointBytes}};
};

}  // namespace clearance
