#include "error_frame.h"

#include <cstring>

#include "wire/wire.h"

namespace clearance {

bool send_error(ReplySink& sink, const wire::FrameHeader& request, std::uint64_t scene_revision, wire::ErrorCode code,
                const std::string& text, std::uint64_t needed_bytes) {
  wire::ErrorHeader error;
  error.code = static_cast<std::uint16_t>(code);
  error.text_bytes = static_cast<std::uint32_t>(text.size());
  error.needed_bytes = needed_bytes;
  const std::uint64_t payload_bytes = sizeof error + text.size();
  const auto header = wire::make_reply_header(request, wire::FrameType::kError, payload_bytes, scene_revision);
  std::byte* frame = sink.reserve(sizeof header + payload_bytes);
  if (!frame) return false;
  std::memcpy(frame, &header, sizeof header);
  std::memcpy(frame + sizeof header, &error, sizeof error);
  std::memcpy(frame + sizeof header + sizeof error, text.data(), text.size());
  sink.publish(sizeof header + payload_bytes);
  return true;
}

}  // namespace clearance
