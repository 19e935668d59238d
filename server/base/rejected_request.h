// Why a request is not answered.
#pragma once

#include <cstdint>
#include <string>

#include "wire/protocol.h"

namespace clearance {

/// Thrown by whatever looks at a request; becomes the error that its client gets.
struct RejectedRequest {
  wire::ErrorCode code;
  std::string text;
  std::uint64_t needed_bytes = 0;  ///< of kTooLarge: room that the reply would need
};

}  // namespace clearance
