// Columns of replies, and of plans in device memory.
#include "wire/checks.h"

namespace clearance::wire {
namespace {

Wide columns_wide(std::uint64_t rows, std::uint32_t fields, std::uint64_t joints) {
  Wide bytes = 0;
  for (int f = 0; f < kFieldCount; ++f)
    if (fields >> f & 1)
      bytes =
          (bytes + Wide(rows) * field_bytes(f, joints) + kColumnAlignment - 1) / kColumnAlignment * kColumnAlignment;
  return bytes;
}

/// Rejects a part outside the memory or before the end of the previous parts.
/// \param end end of the previous parts, then of this one
void expect_inside(const std::string& what, std::uint64_t offset, Wide bytes, std::uint64_t memory,
                   std::uint64_t& end) {
  if (offset < end || Wide(offset) + bytes > memory)
    bad_frame("plan: " + what + " are " + str(bytes) + " bytes from " + str(offset) + " on, expected them from " +
              str(end) + " on in a memory of " + str(memory));
  end = offset + static_cast<std::uint64_t>(bytes);
}

}  // namespace

std::uint64_t columns_bytes(std::uint64_t rows, std::uint32_t fields, std::uint64_t joints) {
  const Wide bytes = columns_wide(rows, fields, joints);
  if (bytes > kMaxPayloadBytes - sizeof(ReplyHeader))
    throw WireError(ErrorCode::kTooLarge, "reply: " + str(rows) + " rows need " + str(bytes) +
                                              " bytes, more than a frame may have (" + str(kMaxFrameBytes) + ")");
  return static_cast<std::uint64_t>(bytes);
}

std::uint64_t column_offset(std::uint64_t rows, std::uint32_t fields, Field field, std::uint64_t joints) {
  std::uint64_t offset = 0;
  for (int f = 0; f < kFieldCount && (1u << f) != field; ++f)
    if (fields >> f & 1) offset = align(offset + rows * field_bytes(f, joints), kColumnAlignment);
  return offset;
}

ReplyHeader parse_reply(std::span<const std::byte> payload, std::span<const std::byte> records, std::uint32_t* joints) {
  const auto header = head<ReplyHeader>(payload, "reply");
  if (header.fields & ~kKnownFields) bad_frame("reply: fields has unknown bits: " + str(header.fields & ~kKnownFields));
  PassedOver passed_over;
  std::uint32_t width = 0;
  read_records("reply", records, passed_over, [&width](const RecordView& record) {
    if (record.tag == static_cast<std::uint16_t>(ReplyRecord::kIgnored)) return true;
    if (record.tag != static_cast<std::uint16_t>(ReplyRecord::kJoints)) return false;
    if (record.bytes.size() != sizeof width)
      bad_frame("reply: joints has " + str(record.bytes.size()) + " bytes, not 4");
    std::memcpy(&width, record.bytes.data(), sizeof width);
    return true;
  });
  if (!(header.fields & kJointFields) != !width)
    bad_frame("reply: columns by joints and the record of how many joints they have come together");
  expect_width("reply", header.fields, width);
  expect_size(
      "reply", [&] { return str(header.rows) + " rows"; },
      sizeof(ReplyHeader) + columns_wide(header.rows, header.fields, width), payload.size());
  // The last column is padded, too, like all others.
  if (strnlen(header.backend, sizeof header.backend) == sizeof header.backend)
    bad_frame("reply: the backend's name does not end");
  if (joints) *joints = width;
  return header;
}

PlanParts parse_plan(std::span<const std::byte> payload) {
  PlanParts parts;
  parts.header = head<PlanHeader>(payload, "plan");
  const PlanHeader& h = parts.header;
  expect_size(
      "plan", [&] { return str(h.column_count) + " columns"; },
      Wide(sizeof h) + Wide(h.column_count) * sizeof(PlanColumnRecord), payload.size());
  expect_zero(h.reserved, "plan");
  if (h.plan == 0) bad_frame("plan: its number is 0");
  if (h.fields & ~kKnownFields) bad_frame("plan: fields has unknown bits: " + str(h.fields & ~kKnownFields));
  expect_width("plan", h.fields, h.joint_count);
  std::uint64_t end = 0;
  if (h.body_count)
    expect_inside("poses", h.poses_offset, Wide(h.configurations) * h.body_count * sizeof(ConfigurationRecord),
                  h.memory_bytes, end);
  if (h.joint_count)
    expect_inside("positions", h.positions_offset, Wide(h.configurations) * h.joint_count * sizeof(double),
                  h.memory_bytes, end);
  parts.columns = Cursor(payload.data() + sizeof h).take<PlanColumnRecord>(h.column_count);
  std::uint64_t next = 0;
  for (int f = 0; f < kFieldCount; ++f) {
    if (!(h.fields >> f & 1)) continue;
    const PlanColumnRecord column = next < h.column_count ? parts.columns[next] : PlanColumnRecord{};
    if (column.field != 1u << f || column.row_bytes != field_bytes(f, h.joint_count))
      bad_frame("plan: columns[" + str(next) + "] is none of " + str(field_bytes(f, h.joint_count)) +
                " bytes a row of the field " + str(1u << f));
    if (column.offset % kColumnAlignment)
      bad_frame("plan: columns[" + str(next) + "] begins at " + str(column.offset) + ", expected a multiple of " +
                str(kColumnAlignment));
    expect_inside("columns[" + str(next) + "]", column.offset, Wide(h.rows) * column.row_bytes, h.memory_bytes, end);
    ++next;
  }
  if (next != h.column_count) bad_frame("plan: " + str(h.column_count) + " columns, and fields of " + str(next));
  return parts;
}

PlanRecord parse_plan_request(std::span<const std::byte> payload) {
  const auto record = head<PlanRecord>(payload, "plan");
  expect_size("plan", its_contents, sizeof record, payload.size());
  if (record.reserved) bad_frame("plan: reserved words must be 0");
  return record;
}

PlanResult parse_plan_done(std::span<const std::byte> payload) {
  const auto result = head<PlanResult>(payload, "plan done");
  expect_size("plan done", its_contents, sizeof result, payload.size());
  expect_zero(result.reserved, "plan done");
  return result;
}

}  // namespace clearance::wire
