#include "server/requests/error_frame.h"

#include <cstring>

#include "wire/wire.h"

namespace clearance {

bool send_error(ReplySink& sink, const wire::FrameHeader& request, std::uint64_t scene_revision, wire::ErrorCode code,
                const std::string& text, std::uint64_t needed_bytes, std::span<const std::byte> records) {
  wire::ErrorHeader error;
  error.code = static_cast<std::uint16_t>(code);
  error.text_bytes = static_cast<std::uint32_t>(text.size());
  error.needed_bytes = needed_bytes;
  const std::uint64_t body_bytes = sizeof error + text.size();
  const auto header = wire::with_records(
      wire::make_reply_header(request, wire::FrameType::kError, body_bytes, scene_revision), records.size());
  std::byte* frame = sink.reserve(sizeof header + header.payload_bytes);
  if (!frame) return false;
  std::memcpy(frame, &header, sizeof header);
  std::memcpy(frame + sizeof header, &error, sizeof error);
  std::memcpy(frame + sizeof header + sizeof error, text.data(), text.size());
  if (!records.empty()) std::memcpy(frame + sizeof header + body_bytes, records.data(), records.size());
  sink.publish(sizeof header + header.payload_bytes);
  return true;
}

}  // namespace clearance
