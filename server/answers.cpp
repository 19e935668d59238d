#include "answers.h"

#include <cstring>

#include "engine/narrow/work_meter.h"
#include "error_frame.h"

namespace clearance {

using wire::ErrorCode;
using wire::FrameHeader;

void Answers::reply(ReplySink& sink, const FrameHeader& request, wire::FrameType type,
                    std::span<const std::byte> payload) {
  std::byte* frame = reserve(sink, payload.size());
  count_copied(payload.size());
  if (!payload.empty()) std::memcpy(frame + sizeof(FrameHeader), payload.data(), payload.size());
  publish(sink, request, type, frame, payload.size());
}

std::byte* Answers::reserve(ReplySink& sink, std::uint64_t payload_bytes) {
  const std::uint64_t bytes = sizeof(FrameHeader) + payload_bytes;
  const auto too_large = [bytes](const char* room) {
    return Refusal{ErrorCode::kTooLarge, "the reply needs " + std::to_string(bytes) + " bytes, more than " + room,
                   bytes};
  };
  if (bytes > wire::kMaxFrameBytes) throw too_large("a frame may have");
  std::byte* frame = sink.reserve(bytes);
  if (!frame) throw too_large("this client has room for");
  return frame;
}

void Answers::publish(ReplySink& sink, const FrameHeader& request, wire::FrameType type, std::byte* frame,
                      std::uint64_t payload_bytes) {
  const auto header = wire::make_reply_header(request, type, payload_bytes, engine_->scene_revision());
  std::memcpy(frame, &header, sizeof header);
  sink.publish(sizeof header + payload_bytes);
  ++stats_.replies;
}

void Answers::count_query(std::uint64_t server_ns, std::uint64_t rows) {
  ++stats_.replies;
  ++stats_.answered;
  stats_.count_latency(server_ns);
  stats_.rows += rows;
}

void Answers::refuse(ReplySink& sink, const FrameHeader& request, const Refusal& refusal) {
  stats_.count_error(std::string(wire::error_name(refusal.code)), refusal.text);
  spdlog::debug("event=refused client={} request={} error=\"{}\"", sink.client(), wire::type_name(request.type),
                log_text(refusal.text));
  try {
    if (!send_error(sink, request, engine_->scene_revision(), refusal.code, refusal.text, refusal.needed_bytes))
      ++stats_["errors.unsent"];
  } catch (const std::exception& failure) {
    ++stats_["errors.unsent"];
    spdlog::warn("event=error_unsent error=\"{}\" cause=\"{}\"", log_text(refusal.text), log_text(failure.what()));
  }
}

}  // namespace clearance
