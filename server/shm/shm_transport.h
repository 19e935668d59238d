// Limits of the shared-memory transport.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "server/requests/transport.h"

namespace clearance {

/// A segment takes address space when it is made, but memory only where it was written to.
struct ShmLimits {
  std::uint32_t slots = 16;                                   ///< of a segment, each for one request under way
  std::uint64_t request_capacity = std::uint64_t{256} << 10;  ///< bytes of one request, in a client's first segment
  std::uint64_t reply_capacity = std::uint64_t{1} << 20;      ///< bytes of one reply, in a client's first segment
  std::uint64_t max_segment_bytes = std::uint64_t{4} << 30;   ///< larger requests and replies are rejected
  std::uint64_t pool_bytes = 0;    ///< of all segments, or 0 for half of the machine's memory
  std::uint64_t pinned_bytes = 0;  ///< of those, that may be pinned for a GPU
  std::uint32_t max_clients = 64;
  std::uint32_t max_segments_per_client = 4;      ///< outgrown ones live until their last reply is returned
  std::chrono::milliseconds hello_timeout{5000};  ///< for a connection's first message
};

/// Throws std::runtime_error with cause and place if the socket cannot be opened.
std::unique_ptr<Transport> make_shm_transport(const std::string& socket_path, const ShmLimits& limits,
                                              const Access& access = {});

}  // namespace clearance
