#include "server/lcm/lcm_points.h"

#include <cstring>
#include <functional>
#include <string_view>

#include "wire/wire.h"

namespace clearance {
namespace {

/// Mark that all parts of a cloud share, made of their common fields.
std::int64_t mark_of(const clearance_lcm::points_t& part) {
  std::size_t mark = std::hash<std::string_view>()(part.body);
  mark = mark * 31 + std::hash<std::int64_t>()(part.stamp_ns);
  mark = mark * 31 + std::hash<double>()(part.radius);
  return static_cast<std::int64_t>(mark);
}

}  // namespace

std::optional<FrameBytes> LcmPoints::add(const clearance_lcm::points_t& part, std::uint32_t body,
                                         Clock::time_point now) {
  clearance_lcm::frame_t bytes{};
  bytes.client_id = part.publisher_id;
  bytes.request_id = mark_of(part);
  bytes.sequence = part.sequence;
  bytes.frame_bytes = std::int64_t{part.total} * static_cast<std::int64_t>(kPointBytes);
  bytes.part = part.part;
  bytes.parts = part.parts;
  bytes.byte_count = static_cast<std::int32_t>(part.xyz.size() * kPointBytes);  // of one datagram
  bytes.bytes.resize(part.xyz.size() * kPointBytes);
  for (std::size_t i = 0; i < part.xyz.size(); ++i)
    std::memcpy(bytes.bytes.data() + i * kPointBytes, part.xyz[i].data(), kPointBytes);
  const std::optional<FrameAssembler::Whole> whole = parts_.add(bytes, now);
  if (!whole) return std::nullopt;

  wire::PointsHeader head;
  head.count = static_cast<std::uint64_t>(part.total);
  head.stamp_ns = part.stamp_ns;
  head.sequence = part.sequence;
  head.has_radius = part.radius >= 0;
  head.radius = head.has_radius ? part.radius : 0;
  head.body = body;
  const std::uint64_t payload = sizeof head + whole->frame.size;
  const wire::FrameHeader header = wire::make_header(wire::FrameType::kSetPoints, 0, payload, 0, 0);
  FrameBytes frame(sizeof header + payload);
  std::memcpy(frame.bytes.get(), &header, sizeof header);
  std::memcpy(frame.bytes.get() + sizeof header, &head, sizeof head);
  if (whole->frame.size > 0)
    std::memcpy(frame.bytes.get() + sizeof header + sizeof head, whole->frame.bytes.get(), whole->frame.size);
  return frame;
}

}  // namespace clearance
