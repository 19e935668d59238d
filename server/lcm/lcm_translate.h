// Conversion between the daemon's frames (wire/protocol.h) and typed LCM messages (lcmtypes/).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "clearance_lcm/distances_t.hpp"
#include "clearance_lcm/query_t.hpp"
#include "clearance_lcm/reply_t.hpp"
#include "clearance_lcm/scene_t.hpp"
#include "clearance_lcm/states_t.hpp"
#include "clearance_lcm/status_t.hpp"
#include "wire/lcm/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {

/// Frame of a query. Fields left at 0 get their defaults. Values are checked with the frame. Throws WireError for
/// columns that reply_t lacks, and for bodies and joints in different numbers of configurations.
/// @param joints ids of the joints that the message names
std::vector<std::byte> query_frame_of(const clearance_lcm::query_t& query, std::span<const std::uint32_t> joints = {});

/// Frame of the query for distances_t: each body's nearest other body, at the current poses.
std::vector<std::byte> nearest_query_frame();

/// A kReply or kError frame, cut into reply_t messages of at most kLcmMessageBytes.
class ReplyParts {
 public:
  /// Takes a frame. A frame of another type, or a damaged one, becomes an error reply (kInternal).
  ReplyParts(FrameBytes frame, std::int64_t server_id, std::int64_t sequence, std::int64_t client_id);
  std::uint64_t size() const { return parts_; }
  clearance_lcm::reply_t operator[](std::uint64_t part) const;

 private:
  FrameBytes frame_;
  clearance_lcm::reply_t common_{};  // fields of every part
  wire::ReplyHeader header_;
  const std::byte* columns_ = nullptr;
  std::uint64_t rows_per_part_ = 1;
  std::uint64_t parts_ = 1;
};

/// All throw wire::WireError for a damaged frame or one of another type.
std::vector<clearance_lcm::scene_t> scene_messages(std::span<const std::byte> scene_frame, std::int64_t server_id);
std::vector<clearance_lcm::distances_t> distances_messages(std::span<const std::byte> reply_frame,
                                                           std::int64_t server_id, std::int64_t sequence);
std::vector<clearance_lcm::states_t> states_messages(std::span<const std::byte> states_frame, std::int64_t server_id,
                                                     std::int64_t sequence, std::uint64_t scene_revision);
/// Counters beyond the size of one message are left out.
clearance_lcm::status_t status_message(std::span<const std::byte> stats_frame, std::int64_t server_id);

}  // namespace clearance
