// Requests of tests that add and remove bodies.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tests/server/core/memory_transport.h"
#include "wire/wire.h"

namespace clearance {

inline std::vector<std::byte> box_frame(const std::string& name, std::uint32_t parent = kNone) {
  wire::NewBodyRecord record;
  wire::set_name(record.name, name);
  record.shape = static_cast<std::uint8_t>(wire::BodyShape::kBox);
  record.size[0] = record.size[1] = record.size[2] = 0.2;
  record.parent = parent;
  record.has_pose = 1;
  record.pose[0] = 3;
  record.pose[3] = 1;
  return simple_frame(wire::FrameType::kAddBody, 1, std::as_bytes(std::span(&record, 1)));
}
/// The same with a record by tag.
inline std::vector<std::byte> box_frame_with(const std::string& name, std::uint16_t tag,
                                             std::span<const std::byte> content) {
  std::vector<std::byte> records;
  wire::append_record(records, tag, wire::kRecordRequired, content);
  return extended(box_frame(name), records);
}
/// The same with a record of the body's uncertainty.
template <class UncertaintyRecord>
std::vector<std::byte> uncertain_frame(const std::string& name, const UncertaintyRecord& uncertainties,
                                       std::uint16_t tag = 20) {
  return box_frame_with(name, tag, std::as_bytes(std::span(&uncertainties, 1)));
}
/// A tetrahedron of up to four corners, with records by tag.
inline std::vector<std::byte> mesh_frame(const std::string& name, std::span<const wire::TriangleRecord> triangles,
                                         std::optional<std::uint8_t> mesh_as,
                                         wire::BodyShape shape = wire::BodyShape::kHull) {
  wire::NewBodyRecord record;
  wire::set_name(record.name, name);
  record.shape = static_cast<std::uint8_t>(shape);
  record.has_pose = 1;
  record.pose[0] = 3;
  record.pose[3] = 1;
  record.vertex_count = shape == wire::BodyShape::kHull ? 4 : 0;
  const wire::VertexRecord corners[] = {{{0, 0, 0}}, {{1, 0, 0}}, {{0, 1, 0}}, {{0, 0, 1}}};
  std::vector<std::byte> payload, records;
  wire::append(payload, record);
  wire::append_bytes(payload, corners, record.vertex_count * sizeof corners[0]);
  if (!triangles.empty()) wire::append_record(records, 21, wire::kRecordRequired, std::as_bytes(triangles));
  if (mesh_as) wire::append_record(records, 22, wire::kRecordRequired, std::as_bytes(std::span(&*mesh_as, 1)));
  return extended(simple_frame(wire::FrameType::kAddBody, 1, payload), records);
}
inline constexpr wire::TriangleRecord kTetrahedron[] = {{{0, 2, 1}}, {{0, 1, 3}}, {{1, 2, 3}}, {{0, 3, 2}}};

inline std::vector<std::byte> remove_frame(const std::string& name) {
  wire::RemoveBodyRecord record;
  wire::set_name(record.name, name);
  return simple_frame(wire::FrameType::kRemoveBody, 2, std::as_bytes(std::span(&record, 1)));
}

}  // namespace clearance
