#include "server/tasks/query_reply.h"

#include <cstring>
#include <string>
#include <utility>

#include "engine/narrow/work_meter.h"
#include "server/base/rejected_request.h"

namespace clearance {
namespace {

/// Offset of the columns in the frame.
constexpr std::uint64_t kColumnsBegin = sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader);
static_assert(kColumnsBegin % wire::kColumnAlignment == 0);

/// Size of a device's reply from which pinned memory saves more (about ten microseconds of copying) than it costs.
constexpr std::uint64_t kWorthPinning = 64 << 10;

/// Moves columns with space for all rows of a size to where they lie with `to_rows` (fewer) rows.
void close_up_columns(std::byte* columns, const QuerySize& size, std::uint64_t to_rows) {
  // Each column moves towards the front, the first ones first, so that none is overwritten before it has moved.
  for (int f = 0; f < kFieldCount; ++f) {
    const Field field = Field(1u << f);
    if (!(size.fields & field)) continue;
    std::memmove(columns + wire::column_offset(to_rows, size.fields, field, size.joints),
                 columns + wire::column_offset(size.rows, size.fields, field, size.joints),
                 to_rows * field_bytes(f, size.joints));
  }
}

/// Zeroes the gaps between columns, so that a reply does not leak former contents of that memory.
void clear_gaps(std::byte* columns, const QuerySize& size, std::uint64_t rows) {
  std::byte* column = columns;
  for (int f = 0; f < kFieldCount; ++f) {
    if (!(size.fields >> f & 1)) continue;
    std::byte* end = column + rows * field_bytes(f, size.joints);
    column += wire::columns_bytes(rows, 1u << f, size.joints);
    std::memset(end, 0, static_cast<std::size_t>(column - end));
  }
}

RejectedRequest no_room(std::uint64_t rows, std::uint64_t bytes) {
  return {wire::ErrorCode::kTooLarge,
          "the reply of " + std::to_string(rows) + " rows needs " + std::to_string(bytes) +
              " bytes, more than this client has room for",
          bytes};
}

}  // namespace

void QueryReply::begin(const QueryView& query, std::vector<std::byte> records) {
  reduce_ = query.reduce;
  records_ = std::move(records);
}

std::uint64_t QueryReply::end_of_columns(std::uint64_t rows) const {
  return kColumnsBegin + wire::columns_bytes(rows, size_.fields, size_.joints);
}

std::byte* QueryReply::columns() const {
  return frame_ + kColumnsBegin;
}

void QueryReply::reserve(ReplySink& sink) {
  const std::uint64_t bytes = most_bytes();
  frame_ = sink.reserve(bytes);
  if (!frame_ && reduce_ == Reduce::kWithin) {  // the rows that come back may fit
    own_ = aligned_bytes(bytes);
    frame_ = own_.get();
  }
  if (!frame_) throw no_room(size_.rows, bytes);
}

ReplyView QueryReply::view() const {
  return reply_view_over(columns(), size_.rows, size_.fields, nullptr, size_.joints);
}

void QueryReply::close_up(ReplyInfo info) {
  info_ = std::move(info);
  if (info_.rows < size_.rows) close_up_columns(columns(), size_, info_.rows);
  clear_gaps(columns(), size_, info_.rows);
}

void QueryReply::reserve_final(ReplySink& sink) {
  const std::uint64_t bytes = end_of_columns(info_.rows) + records_.size();
  frame_ = sink.reserve(bytes);
  if (!frame_) throw no_room(info_.rows, bytes);
}

void QueryReply::copy() {
  const std::uint64_t end = end_of_columns(info_.rows);
  count_copied(end);
  std::memcpy(columns(), own_.get() + kColumnsBegin, end - kColumnsBegin);
}

void QueryReply::publish(ReplySink& sink, const wire::FrameHeader& request, const Times& times) {
  const std::uint64_t end = end_of_columns(info_.rows), bytes = end + records_.size();
  std::memcpy(frame_ + end, records_.data(), records_.size());
  const auto frame_header = wire::with_records(
      wire::make_reply_header(request, wire::FrameType::kReply, end - sizeof(wire::FrameHeader), info_.scene_revision),
      records_.size());
  const wire::ReplyHeader reply_header = header(times);
  std::memcpy(frame_, &frame_header, sizeof frame_header);
  std::memcpy(frame_ + sizeof frame_header, &reply_header, sizeof reply_header);
  if (bytes >= kWorthPinning && info_.backend == "cuda") sink.written_by_device();
  sink.publish(bytes);
}

wire::ReplyHeader QueryReply::header(const Times& times) const {
  wire::ReplyHeader reply;
  reply.rows = info_.rows;
  reply.total = info_.total;
  reply.configurations = size_.configurations;
  reply.pairs = size_.pairs;
  reply.fields = size_.fields;
  reply.reduce = static_cast<std::uint8_t>(reduce_);
  reply.scene_revision = info_.scene_revision;
  reply.snapshot_revision = info_.snapshot_revision;
  reply.snapshot_stamp_ns = info_.snapshot_stamp_ns;
  reply.oldest_receipt_ns = info_.oldest_receipt_ns;
  reply.snapshot_sequence = info_.snapshot_sequence;
  reply.pose_age_ns = info_.pose_age_ns;
  reply.pairs_evaluated = info_.pairs_evaluated;
  wire::set_name(reply.backend, info_.backend);
  reply.engine_ns = static_cast<std::uint64_t>(times.in_engine.count());
  reply.server_ns = static_cast<std::uint64_t>(times.in_server.count());
  return reply;
}

}  // namespace clearance
