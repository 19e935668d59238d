// Reason to reject a request.
#pragma once

#include <cstdint>
#include <string>

#include "wire/protocol.h"

namespace clearance {

/// Thrown while a request is checked or answered, and sent to its client as an error.
struct RejectedRequest {
  wire::ErrorCode code;
  std::string text;
  std::uint64_t needed_bytes = 0;  ///< of kTooLarge: bytes that the reply would need
};

}  // namespace clearance
