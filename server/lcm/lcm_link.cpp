#include "server/lcm/lcm_link.h"

#include <algorithm>

#include "server/lcm/lcm_translate.h"

namespace clearance {

void LcmLink::push(LcmOutbox& box, std::uint64_t parts, std::uint64_t bytes, LcmOutbox::SendPart send_part) {
  if (!box.push(parts, bytes, std::move(send_part))) ++dropped;
  box.flush(LcmOutbox::Clock::now());
}

std::byte* LcmSink::reserve(std::uint64_t frame_bytes) {
  frame_ = {};
  if (frame_bytes > kMaxReplyBytes) return nullptr;
  frame_ = FrameBytes(frame_bytes);
  return frame_.bytes.get();
}

void LcmSink::publish(std::uint64_t frame_bytes) {
  frame_.size = std::min(frame_.size, frame_bytes);
  if (const auto link = link_.lock()) deliver_(*link, std::move(frame_));
}

LcmSink::Deliver reply_to(std::int64_t client) {
  return [client](LcmLink& link, FrameBytes frame) {
    const std::uint64_t bytes = frame.size;
    const auto parts = std::make_shared<ReplyParts>(std::move(frame), link.server_id, ++link.last_sequence, client);
    ++link.replies;
    link.push(link.outbox, parts->size(), bytes,
              [&link, parts](std::uint64_t i) { return link.send("CLEARANCE_REPLY", (*parts)[i]); });
  };
}

LcmSink::Deliver frame_to(std::int64_t client, std::int64_t request) {
  return [client, request](LcmLink& link, FrameBytes frame) {
    const std::uint64_t bytes = frame.size;
    const auto whole = std::make_shared<FrameBytes>(std::move(frame));
    const std::int64_t sequence = ++link.last_sequence;
    ++link.replies;
    link.push(link.outbox, frame_part_count(bytes), bytes, [&link, whole, sequence, client, request](std::uint64_t i) {
      clearance_lcm::frame_t part = frame_part(whole->span(), i);
      part.server_id = link.server_id;
      part.client_id = client;
      part.request_id = request;
      part.sequence = sequence;
      return link.send("CLEARANCE_FRAME_OUT", part);
    });
  };
}

}  // namespace clearance
