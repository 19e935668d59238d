#include "wire/lcm/lcm_frames.h"

#include <algorithm>

#include "wire/protocol.h"

namespace clearance {
namespace {
constexpr std::uint64_t kPartBytes = clearance_lcm::frame_t::PART_BYTES;
}

std::uint64_t frame_part_count(std::uint64_t frame_bytes, std::uint64_t part_bytes) {
  return std::max<std::uint64_t>(1, (frame_bytes + part_bytes - 1) / part_bytes);
}

clearance_lcm::frame_t frame_part(std::span<const std::byte> frame, std::uint64_t part) {
  clearance_lcm::frame_t message{};
  const std::uint64_t begin = part * kPartBytes;
  const std::uint64_t size = std::min<std::uint64_t>(kPartBytes, frame.size() - begin);
  message.frame_bytes = static_cast<std::int64_t>(frame.size());
  message.part = static_cast<std::int32_t>(part);
  message.parts = static_cast<std::int32_t>(frame_part_count(frame.size()));
  message.byte_count = static_cast<std::int32_t>(size);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(frame.data()) + begin;
  message.bytes.assign(bytes, bytes + size);
  return message;
}

std::optional<FrameAssembler::Whole> FrameAssembler::add(const clearance_lcm::frame_t& part, Clock::time_point now) {
  expire(now);
  const auto frame_bytes = static_cast<std::uint64_t>(part.frame_bytes);
  static_assert(sizeof(wire::FrameHeader) == 64);  // Limits::least_bytes
  const std::uint64_t part_bytes = limits_.part_bytes;
  const bool sizes_fit = part.frame_bytes >= static_cast<std::int64_t>(limits_.least_bytes) &&
                         frame_bytes <= limits_.frame_bytes && part.part >= 0 && part.part < part.parts &&
                         static_cast<std::uint64_t>(part.parts) == frame_part_count(frame_bytes, part_bytes);
  const std::uint64_t begin = static_cast<std::uint64_t>(part.part) * part_bytes;
  if (!sizes_fit || static_cast<std::uint64_t>(part.byte_count) != std::min(part_bytes, frame_bytes - begin) ||
      part.bytes.size() != static_cast<std::size_t>(part.byte_count)) {
    ++counts_.bad;
    return std::nullopt;
  }

  auto it = std::find_if(partials_.begin(), partials_.end(), [&](const Partial& p) {
    return p.sequence == part.sequence && p.whole.client_id == part.client_id && p.whole.server_id == part.server_id;
  });
  if (it == partials_.end()) {
    while (!partials_.empty() && (partials_.size() >= limits_.frames || bytes_ + frame_bytes > limits_.total_bytes)) {
      give_up(partials_.begin());
    }
    Partial partial;
    partial.whole = {part.server_id, part.client_id, part.request_id, FrameBytes(frame_bytes)};
    partial.sequence = part.sequence;
    partial.missing = static_cast<std::uint64_t>(part.parts);
    partial.there.assign(partial.missing, false);
    bytes_ += frame_bytes;
    it = partials_.insert(partials_.end(), std::move(partial));
  } else if (it->whole.request_id != part.request_id || it->whole.frame.size != frame_bytes) {
    ++counts_.bad;
    return std::nullopt;
  }

  const auto index = static_cast<std::size_t>(part.part);
  if (it->there[index]) {
    ++counts_.repeated;
    return std::nullopt;
  }
  it->there[index] = true;
  std::copy(part.bytes.begin(), part.bytes.end(), reinterpret_cast<std::uint8_t*>(it->whole.frame.bytes.get()) + begin);
  it->last = now;
  partials_.splice(partials_.end(), partials_, it);
  if (--it->missing > 0) return std::nullopt;
  Whole whole = std::move(it->whole);
  bytes_ -= frame_bytes;
  partials_.erase(it);
  return whole;
}

void FrameAssembler::expire(Clock::time_point now) {
  while (!partials_.empty() && now - partials_.front().last > limits_.age) give_up(partials_.begin());
}

void FrameAssembler::give_up(std::list<Partial>::iterator partial) {
  bytes_ -= partial->whole.frame.size;
  partials_.erase(partial);
  ++counts_.given_up;
}

}  // namespace clearance
