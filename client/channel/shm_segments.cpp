#include "client/channel/shm_segments.h"

#include <algorithm>
#include <bit>

namespace clearance {

bool ShmSegments::grow(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline,
                       const Channel::Watch& watch, std::string& why) {
  // Doubling avoids a new segment for every slightly larger batch; near the limits, sizes are exact.
  const auto doubled = [](std::uint64_t bytes, std::uint64_t limit) {
    return bytes > limit / 2 ? bytes : std::bit_ceil(bytes);
  };
  return request(doubled(request_bytes, wire::kMaxRequestBytes), doubled(reply_bytes, wire::kMaxFrameBytes), deadline,
                 watch, why) ||
         request(request_bytes, reply_bytes, deadline, watch, why);
}

bool ShmSegments::request(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline,
                          const Channel::Watch& watch, std::string& why) {
  request_bytes = std::max(request_bytes, current_->request_capacity());
  reply_bytes = std::max(reply_bytes, current_->reply_capacity());
  const shm::UniqueFd fd = socket_.request_segment(request_bytes, reply_bytes, deadline, watch, why);
  if (!fd) return false;
  auto larger = std::make_shared<ClientSegment>(fd, url_);
  if (larger->request_capacity() < request_bytes || larger->reply_capacity() < reply_bytes)
    socket_.die("the daemon handed over a smaller segment than requested");
  outgrown_.push_back(std::exchange(current_, std::move(larger)));
  retire_outgrown();
  return true;
}

void ShmSegments::retire_outgrown() {
  std::erase_if(outgrown_,
                [this](const SegmentPtr& segment) { return segment->all_free() && socket_.retire(segment->id()); });
}

std::pair<SegmentPtr, std::uint32_t> ShmSegments::find(std::uint64_t request_id) const {
  const auto look = [&](const SegmentPtr& segment) -> int {
    const auto& slots = segment->slots();
    for (std::size_t i = 0; i < slots.size(); ++i)
      if (slots[i].request_id == request_id && slots[i].state != ClientSegment::State::kIdle && !slots[i].forgotten)
        return static_cast<int>(i);
    return -1;
  };
  if (const int slot = look(current_); slot >= 0) return {current_, slot};
  for (const SegmentPtr& segment : outgrown_)
    if (const int slot = look(segment); slot >= 0) return {segment, slot};
  return {nullptr, 0};
}

bool ShmSegments::collect() {
  bool sane = current_->collect();
  for (const SegmentPtr& segment : outgrown_) sane = segment->collect() && sane;
  return sane;
}

}  // namespace clearance
