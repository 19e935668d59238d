// Limits of the shared-memory transport.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "server/requests/transport.h"

namespace clearance {

/// A segment costs address space when it is made, and memory only where it was once written to.
struct ShmLimits {
  std::uint32_t slots = 16;                                   ///< of a segment: requests a client may have outstanding
  std::uint64_t request_capacity = std::uint64_t{256} << 10;  ///< bytes of one request, in a client's first segment
  std::uint64_t reply_capacity = std::uint64_t{1} << 20;      ///< bytes of one reply, in a client's first segment
  std::uint64_t max_segment_bytes = std::uint64_t{4} << 30;   ///< a request or reply that needs a larger one is refused
  std::uint64_t pool_bytes = 0;    ///< of all segments together; 0: half of the machine's memory
  std::uint64_t pinned_bytes = 0;  ///< of them, that may be pinned for a GPU to write to
  std::uint32_t max_clients = 64;
  std::uint32_t max_segments_per_client = 4;      ///< outgrown ones live until their last reply is given back
  std::chrono::milliseconds hello_timeout{5000};  ///< a connection that says nothing is closed after it
};

/// Throws std::runtime_error with cause and place if the socket cannot be opened.
std::unique_ptr<Transport> make_shm_transport(const std::string& socket_path, const ShmLimits& limits,
                                              const Access& access = {});

}  // namespace clearance
