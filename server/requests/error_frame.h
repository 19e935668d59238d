// Error replies.
#pragma once

#include <string>

#include "server/requests/transport.h"

namespace clearance {

/// Answers `request` with kError. Returns false if the client has no space even for that.
/// @param needed_bytes of kTooLarge: bytes that the reply would need
/// @param records at the reply's end
bool send_error(ReplySink& sink, const wire::FrameHeader& request, std::uint64_t scene_revision, wire::ErrorCode code,
                const std::string& text, std::uint64_t needed_bytes = 0, std::span<const std::byte> records = {});

}  // namespace clearance
