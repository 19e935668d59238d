#include "running_query.h"

#include <cstring>

namespace clearance {
namespace {

using wire::FrameHeader;

/// A device's reply from this size on is worth memory that the device writes to itself: some ten microseconds of
/// copying.
constexpr std::uint64_t kWorthPinning = 64 << 10;

/// Moves columns that have room for `from_rows` rows to where they lie with `to_rows` (fewer) rows.
void close_up_columns(std::byte* columns, std::uint32_t fields, std::uint64_t from_rows, std::uint64_t to_rows) {
  // Each column moves towards the front, the first ones first: nothing is overwritten before it has moved.
  for (int f = 0; f < kFieldCount; ++f) {
    const Field field = Field(1u << f);
    if (!(fields & field)) continue;
    std::memmove(columns + wire::column_offset(to_rows, fields, field),
                 columns + wire::column_offset(from_rows, fields, field), to_rows * kFieldBytes[f]);
  }
}

/// Zeroes what lies between the columns: whatever was in that memory is nobody's business.
void clear_gaps(std::byte* columns, std::uint32_t fields, std::uint64_t rows) {
  std::byte* column = columns;
  for (int f = 0; f < kFieldCount; ++f) {
    if (!(fields >> f & 1)) continue;
    std::byte* end = column + rows * kFieldBytes[f];
    column += wire::columns_bytes(rows, 1u << f);
    std::memset(end, 0, static_cast<std::size_t>(column - end));
  }
}

Refusal no_room(std::uint64_t rows, std::uint64_t bytes) {
  return {wire::ErrorCode::kTooLarge,
          "the reply of " + std::to_string(rows) + " rows needs " + std::to_string(bytes) +
              " bytes, more than this client has room for",
          bytes};
}

}  // namespace

void check_reply_size(std::uint64_t rows, std::uint64_t bytes, std::uint64_t most) {
  if (most && bytes > most)
    throw Refusal{wire::ErrorCode::kTooLarge,
                  "the reply of " + std::to_string(rows) + " rows needs " + std::to_string(bytes) +
                      " bytes, more than the max_reply_bytes = " + std::to_string(most) + " of this query"};
}

ReplyRoom reserve_room(ReplySink& sink, const QuerySize& size, Reduce reduce, std::uint64_t records_bytes) {
  const std::uint64_t bytes = kColumnsBegin + wire::columns_bytes(size.rows, size.fields) + records_bytes;
  ReplyRoom room{sink.reserve(bytes), nullptr};
  if (!room.frame && reduce == Reduce::kWithin) {  // what comes back may well fit
    room.own = aligned_bytes(bytes);
    room.frame = room.own.get();
  }
  if (!room.frame) throw no_room(size.rows, bytes);
  return room;
}

RunningQuery::RunningQuery(Answers& answers, std::unique_ptr<ReplySink>&& sink, const FrameHeader& request,
                           Quotas::Share share, std::shared_ptr<Engine> engine, Job job, ReplyRoom room, Traits traits)
    : ScheduledQuery(sink->client(), traits.due),
      answers_(answers),
      asked_{std::move(sink), request, std::move(share)},
      engine_(std::move(engine)),
      job_(std::move(job)),
      room_(std::move(room)),
      traits_(std::move(traits)) {}

bool RunningQuery::advance(std::chrono::nanoseconds budget, Clock::time_point& now) {
  bool done = false;
  const bool worked = answers_.guard(*asked_.sink, asked_.header, [&] { done = job_.advance(budget); });
  const auto after = Clock::now();
  traits_.in_engine += after - now;
  now = after;
  if (done) answers_.guard(*asked_.sink, asked_.header, [&] { publish(after); });
  return done || !worked;
}

void RunningQuery::publish(Clock::time_point now) {
  const QuerySize& size = job_.size();
  const ReplyInfo& info = job_.info();
  std::byte* columns = room_.frame + kColumnsBegin;
  if (info.rows < size.rows) close_up_columns(columns, size.fields, size.rows, info.rows);
  clear_gaps(columns, size.fields, info.rows);
  const std::uint64_t columns_end = kColumnsBegin + wire::columns_bytes(info.rows, size.fields);
  const std::uint64_t bytes = columns_end + traits_.records.size();
  check_reply_size(info.rows, bytes, traits_.max_reply_bytes);
  std::byte* frame = final_frame(columns_end, bytes);
  if (!traits_.records.empty()) std::memcpy(frame + columns_end, traits_.records.data(), traits_.records.size());
  const auto header =
      wire::with_records(wire::make_reply_header(asked_.header, wire::FrameType::kReply,
                                                 columns_end - sizeof(FrameHeader), info.scene_revision),
                         traits_.records.size());
  const wire::ReplyHeader reply = reply_header(now);
  std::memcpy(frame, &header, sizeof header);
  std::memcpy(frame + sizeof header, &reply, sizeof reply);
  if (bytes >= kWorthPinning && info.backend == "cuda") asked_.sink->written_by_device();
  asked_.sink->publish(bytes);
  answers_.count_query(reply.server_ns, info.rows);
}

/// Where the reply is sent from: it has been written there, or is copied there now that its size is known.
std::byte* RunningQuery::final_frame(std::uint64_t columns_end, std::uint64_t bytes) {
  if (!room_.own) return room_.frame;
  std::byte* frame = asked_.sink->reserve(bytes);
  if (!frame) throw no_room(job_.info().rows, bytes);
  std::memcpy(frame + kColumnsBegin, room_.own.get() + kColumnsBegin, columns_end - kColumnsBegin);
  return frame;
}

wire::ReplyHeader RunningQuery::reply_header(Clock::time_point now) const {
  const QuerySize& size = job_.size();
  const ReplyInfo& info = job_.info();
  wire::ReplyHeader reply;
  reply.rows = info.rows;
  reply.total = info.total;
  reply.configurations = size.configurations;
  reply.pairs = size.pairs;
  reply.fields = size.fields;
  reply.reduce = static_cast<std::uint8_t>(traits_.reduce);
  reply.format = static_cast<std::uint8_t>(traits_.format);
  reply.scene_revision = info.scene_revision;
  reply.snapshot_revision = info.snapshot_revision;
  reply.snapshot_stamp_ns = info.snapshot_stamp_ns;
  reply.oldest_receipt_ns = info.oldest_receipt_ns;
  reply.snapshot_sequence = info.snapshot_sequence;
  reply.pose_age_ns = info.pose_age_ns;
  reply.pairs_evaluated = info.pairs_evaluated;
  wire::set_name(reply.backend, info.backend);
  reply.engine_ns = static_cast<std::uint64_t>(traits_.in_engine.count());
  reply.server_ns = static_cast<std::uint64_t>(std::chrono::nanoseconds(now - traits_.received).count());
  return reply;
}

}  // namespace clearance
