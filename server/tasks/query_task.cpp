#include "server/tasks/query_task.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace clearance {
namespace {

using wire::FrameHeader;

/// A device's reply from this size on is worth memory that the device writes to itself: some ten microseconds of
/// copying.
constexpr std::uint64_t kWorthPinning = 64 << 10;

/// More pairs than memory holds: so that their bytes are a number.
constexpr std::uint64_t kMostListed = std::uint64_t{1} << 56;

/// Moves columns that have room for all rows of a size to where they lie with `to_rows` (fewer) rows.
void close_up_columns(std::byte* columns, const QuerySize& size, std::uint64_t to_rows) {
  // Each column moves towards the front, the first ones first: nothing is overwritten before it has moved.
  for (int f = 0; f < kFieldCount; ++f) {
    const Field field = Field(1u << f);
    if (!(size.fields & field)) continue;
    std::memmove(columns + wire::column_offset(to_rows, size.fields, field, size.joints),
                 columns + wire::column_offset(size.rows, size.fields, field, size.joints),
                 to_rows * field_bytes(f, size.joints));
  }
}

/// Zeroes what lies between the columns: whatever was in that memory is nobody's business.
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

QueryView view_of(const wire::QueryParts& parts, std::uint64_t scene_revision) {
  const wire::QueryHeader& h = parts.header;
  static_assert(sizeof(BodyPair) == sizeof(wire::PairRecord) && sizeof(Pose) == sizeof(wire::ConfigurationRecord));
  QueryView q;
  q.pairs = {reinterpret_cast<const BodyPair*>(parts.pairs.data()), static_cast<std::size_t>(parts.pairs.size())};
  q.bodies = {reinterpret_cast<const std::uint32_t*>(parts.bodies.data()),
              static_cast<std::size_t>(parts.bodies.size())};
  q.configurations = {reinterpret_cast<const Pose*>(parts.configurations.data()),
                      static_cast<std::size_t>(parts.configurations.size())};
  q.joints = {reinterpret_cast<const std::uint32_t*>(parts.joints.data()),
              static_cast<std::size_t>(parts.joints.size())};
  q.positions = {reinterpret_cast<const double*>(parts.positions.data()),
                 static_cast<std::size_t>(parts.positions.size())};
  q.all_pairs = h.all_pairs;
  q.configuration_count = h.configuration_count;
  copy_options(parts.options, q);
  q.margins = {reinterpret_cast<const MarginEntry*>(parts.margins.data()),
               static_cast<std::size_t>(parts.margins.size())};
  q.pair_margins = {reinterpret_cast<const double*>(parts.pair_margins.data()),
                    static_cast<std::size_t>(parts.pair_margins.size())};
  q.weights = {reinterpret_cast<const double*>(parts.weights.data()), static_cast<std::size_t>(parts.weights.size())};
  q.scene_revision = scene_revision;
  return q;
}

std::span<const std::byte> aligned(std::span<const std::byte> payload, std::vector<std::uint64_t>& room) {
  if (payload.empty() || reinterpret_cast<std::uintptr_t>(payload.data()) % alignof(std::uint64_t) == 0) return payload;
  room.resize((payload.size() + 7) / 8);
  std::memcpy(room.data(), payload.data(), payload.size());
  return std::as_bytes(std::span(room)).first(payload.size());
}

void QueryTask::Limits::check(const QueryCost& extent) const {
  if (const std::uint64_t pieces = extent.piece_pairs; pieces > max_piece_pairs)
    throw RejectedRequest{wire::ErrorCode::kTooLarge,
                          "the pairs that this query names have " + std::to_string(pieces) +
                              " pairs of pieces, more than the " + std::to_string(max_piece_pairs) +
                              " that one query may ask about (limit max-piece-pairs): split it"};
}

void QueryTask::Limits::check(const QuerySize& size) const {
  if (size.pairs && size.configurations > max_pairs / size.pairs)
    throw RejectedRequest{wire::ErrorCode::kTooLarge, std::to_string(size.configurations) + " configurations of " +
                                                          std::to_string(size.pairs) + " pairs are more than the " +
                                                          std::to_string(max_pairs) +
                                                          " that one query may ask about (limit max-pairs): split it"};
}

void QueryTask::take_options(const QueryOptions& options, const QueryCost& extent) {
  options_ = options;
  extent_ = extent;
  options_settled_ = true;
  if (options.deadline_ns == 0) return;
  deadline_ = received_ + std::chrono::nanoseconds(options.deadline_ns);
  const auto now = Clock::now();
  check_deadline(now);
  daemon_.forecast.check(Forecast::work_of(options_, extent_), deadline_ - now,
                         std::chrono::nanoseconds(options.deadline_ns));
}

void QueryTask::check_deadline(Clock::time_point now) const {
  if (now >= deadline_) throw deadline_passed(std::chrono::nanoseconds(options_.deadline_ns), in_engine_);
}

void QueryTask::begin_here(const wire::QueryParts& parts, std::uint64_t payload_bytes,
                           std::unique_ptr<ReplySink>& sink) {
  worked_ = Clock::now();
  const auto begun = worked_;
  on_loop_ = true;
  payload_bytes_ = payload_bytes;
  prepare(parts);
  list({});
  prepared_->keep_on_cpu();
  take_room(*sink);
  start();
  worked_ = Clock::now();
  in_engine_ = worked_ - begun;
  asked_.sink = std::move(sink);  // now that nothing can fail any more
}

void QueryTask::begin_elsewhere(std::function<OwnPayload()> fetch, std::uint64_t payload_bytes,
                                std::uint64_t listed_pairs, std::unique_ptr<ReplySink>& sink) {
  const std::uint64_t bytes = payload_bytes + std::min(listed_pairs, kMostListed) * sizeof(BodyPair);
  daemon_.quotas.check_bytes(client(), service_class(), bytes, sink->unsent_bytes());
  fetch_ = std::move(fetch);
  payload_bytes_ = payload_bytes;
  asked_.share = daemon_.quotas.take(client(), service_class(), bytes);
  asked_.sink = std::move(sink);
}

bool QueryTask::advance(std::chrono::nanoseconds budget, Clock::time_point& now) {
  failure_ = ReplyWriter::refusal_of(asked_.header, [&] {
    check_deadline(now);
    if (step_ == Step::kPrepare) {
      read();
    } else if (step_ == Step::kList) {
      list({.time = std::min<std::chrono::nanoseconds>(budget, deadline_ - now)});
    } else if (step_ == Step::kRun) {
      run(std::min<std::chrono::nanoseconds>(budget, deadline_ - now));
    } else if (step_ == Step::kCopy) {
      count_copied(columns_end());
      std::memcpy(frame_ + kColumnsBegin, own_.get() + kColumnsBegin, columns_end() - kColumnsBegin);
      step_ = Step::kPublish;
    }
  });
  if (failure_ || step_ == Step::kPublish || step_ == Step::kOver) let_go();
  worked_ = Clock::now();
  in_engine_ += worked_ - now;
  now = worked_;
  return failure_ || (step_ != Step::kList && step_ != Step::kRun) || on_loop_;
}

void QueryTask::let_go() {
  fetch_ = nullptr;
  prepared_.reset();
  job_.reset();
  payload_ = {};
  aligned_ = {};
  own_.reset();
  engine_.reset();  // the last one of a scene that is gone may take long to free
}

/// Only before it has room for its reply, to which somebody may be writing: then it ends with its slice.
void QueryTask::expire() {
  if (frame_ || is_ended_) return;
  daemon_.answers.refuse(*asked_.sink, asked_.header,
                         deadline_passed(std::chrono::nanoseconds(options_.deadline_ns), std::chrono::nanoseconds(0)));
  is_ended_ = true;
  gone_.store(true, std::memory_order_relaxed);
}

/// Nobody waits for it any more: once more to whoever works, who frees what there is.
void QueryTask::end() {
  is_ended_ = true;
  step_ = Step::kOver;
}

bool QueryTask::settle() {
  if (step_ == Step::kOver) return true;
  if (is_ended_) {
    end();
    return false;
  }
  if (!asked_.sink->alive()) {
    ++daemon_.stats.dropped;
    ++daemon_.stats["queries.dropped"];
    end();
  } else if (failure_) {
    if (failure_->code == wire::ErrorCode::kDeadline && in_engine_.count() > 0)
      daemon_.forecast.note(Forecast::work_of(options_, extent_), in_engine_, false);
    daemon_.answers.refuse(*asked_.sink, asked_.header, *failure_);
    return true;
  } else if (step_ == Step::kPublish) {
    daemon_.answers.guard(*asked_.sink, asked_.header, [&] { publish(); });
    return true;
  } else if (!daemon_.answers.guard(*asked_.sink, asked_.header, [&] {
               if (step_ == Step::kOptions) settle_options();
               if (step_ == Step::kRoom) take_room(*asked_.sink);
               if (step_ == Step::kFinalRoom) take_final_room();
             })) {
    end();
  }
  if (!asked_.sink) return true;  // held
  if (on_loop_ && step_ == Step::kRun) ++daemon_.stats["queries.handed_over"];
  on_loop_ = false;
  return false;
}

/// Begins anew at once if the poses are there that it waits for, else when they are.
void QueryTask::settle_options() {
  if (options_.as_planning) set_service_class(ServiceClass::kPlanning);
  asked_.share.give_back();  // what is held has its own
  if (options_.min_pose_stamp_ns != 0 &&
      daemon_.hold(asked_.header, service_class(), options_, payload_, asked_.sink, received_))
    return;
  asked_.share = daemon_.quotas.take(client(), service_class(), payload_bytes_);
  take_options(options_, extent_);
  step_ = Step::kPrepare;
}

/// What came with the request.
void QueryTask::read() {
  if (fetch_) payload_ = std::exchange(fetch_, nullptr)();
  const wire::QueryParts parts = wire::parse_query(asked_.header, aligned(payload_.span(), aligned_));
  daemon_.answers.check_epoch(asked_.header, parts.epoch);
  const QueryOptions& asked = parts.options;
  if (!options_settled_ && (asked.min_pose_stamp_ns != 0 || asked.deadline_ns != 0 || asked.as_planning)) {
    options_ = asked;
    extent_ = engine_->extent(view_of(parts, asked_.header.scene_revision));
    step_ = Step::kOptions;
    return;
  }
  prepare(parts);
  step_ = Step::kList;
}

void QueryTask::prepare(const wire::QueryParts& parts) {
  QueryView query = view_of(parts, asked_.header.scene_revision);
  if (!options_settled_) {
    options_ = parts.options;
    extent_ = engine_->extent(query);
  }
  daemon_.limits.check(extent_);
  query.warm_slot = parts.options.warm ? client() : 0;
  wants_warm_ = parts.options.warm;
  reduce_ = query.reduce;
  format_ = query.format;
  // The engine keeps the configurations and the pairs, unless these are the scene's whole table.
  whole_table_ = parts.header.all_pairs && parts.bodies.size() == 0 && parts.joints.size() == 0;
  const bool by_joints = query.fields & kFieldGradientJoints && query.format == Format::kFull;
  records_ = daemon_.answers.records(parts.passed_over, by_joints ? query.joints.size() : 0);
  prepared_ = engine_->begin_preparing(query);
}

/// The pairs that it names.
void QueryTask::list(const WorkBudget& budget) {
  if (!prepared_->advance(budget)) return;
  size_ = prepared_->size();
  daemon_.limits.check(size_);
  step_ = Step::kRoom;
}

/// Room for the reply: what the client may have under way, and memory for the most rows that may come back.
void QueryTask::take_room(ReplySink& sink) {
  const std::uint64_t reply_bytes =
      kColumnsBegin + wire::columns_bytes(size_.rows, size_.fields, size_.joints) + records_.size();
  std::uint64_t bytes = reply_bytes + payload_bytes_ + (whole_table_ ? 0 : size_.pairs * sizeof(BodyPair));
  asked_.share.give_back();
  const std::uint64_t left = daemon_.quotas.check_bytes(client(), service_class(), bytes, sink.unsent_bytes());
  // Warm state has what is left, and makes way: without it an answer takes longer, and no more.
  QueryView query;
  query.warm_slot = wants_warm_ ? client() : 0;
  query.reduce = reduce_;
  std::uint64_t warm = Engine::warm_bytes(query, size_);
  if (warm > left) {
    warm = 0;
    prepared_->begin_cold();
    ++daemon_.stats["queries.cold"];
  }
  if (warm == 0 && left < Engine::kMostWarmBytes)  // else the query takes what was left
    if (auto table = engine_->trim_warm(client(), left)) daemon_.drop(std::move(table));
  asked_.share = daemon_.quotas.take(client(), service_class(), bytes + warm);
  frame_ = sink.reserve(reply_bytes);
  if (!frame_ && reduce_ == Reduce::kWithin) {  // what comes back may well fit
    own_ = aligned_bytes(reply_bytes);
    frame_ = own_.get();
  }
  if (!frame_) throw no_room(size_.rows, reply_bytes);
  step_ = Step::kRun;
}

/// The job copies what it needs of the request.
void QueryTask::start() {
  job_ = engine_->start(std::move(*prepared_),
                        reply_view_over(frame_ + kColumnsBegin, size_.rows, size_.fields, nullptr, size_.joints));
  prepared_.reset();
  payload_ = {};
  aligned_ = {};
}

void QueryTask::run(std::chrono::nanoseconds budget) {
  if (!job_) start();
  const bool is_beside = daemon_.limits.has_control && service_class() != ServiceClass::kControl;
  const WorkBudget& on_loop = is_beside ? daemon_.limits.on_loop_beside_control : daemon_.limits.on_loop;
  const bool done = job_->advance(on_loop_ ? on_loop : WorkBudget{.time = budget});
  units_ = job_->units();
  if (!done) return;
  info_ = job_->info();
  std::byte* columns = frame_ + kColumnsBegin;
  if (info_.rows < size_.rows) close_up_columns(columns, size_, info_.rows);
  clear_gaps(columns, size_, info_.rows);
  step_ = own_ ? Step::kFinalRoom : Step::kPublish;
}

/// Where the reply is sent from, now that its size is known.
void QueryTask::take_final_room() {
  const std::uint64_t bytes = columns_end() + records_.size();
  frame_ = asked_.sink->reserve(bytes);
  if (!frame_) throw no_room(info_.rows, bytes);
  step_ = Step::kCopy;
}

void QueryTask::publish() {
  const std::uint64_t bytes = columns_end() + records_.size();
  std::memcpy(frame_ + columns_end(), records_.data(), records_.size());
  const auto header =
      wire::with_records(wire::make_reply_header(asked_.header, wire::FrameType::kReply,
                                                 columns_end() - sizeof(FrameHeader), info_.scene_revision),
                         records_.size());
  if (!on_loop_) worked_ = Clock::now();
  check_deadline(worked_);
  daemon_.forecast.note(Forecast::work_of(options_, extent_), in_engine_, true);
  const wire::ReplyHeader reply = reply_header();
  std::memcpy(frame_, &header, sizeof header);
  std::memcpy(frame_ + sizeof header, &reply, sizeof reply);
  if (bytes >= kWorthPinning && info_.backend == "cuda") asked_.sink->written_by_device();
  asked_.sink->publish(bytes);
  daemon_.answers.count_query(reply.server_ns, info_.rows);
}

wire::ReplyHeader QueryTask::reply_header() const {
  wire::ReplyHeader reply;
  reply.rows = info_.rows;
  reply.total = info_.total;
  reply.configurations = size_.configurations;
  reply.pairs = size_.pairs;
  reply.fields = size_.fields;
  reply.reduce = static_cast<std::uint8_t>(reduce_);
  reply.format = static_cast<std::uint8_t>(format_);
  reply.scene_revision = info_.scene_revision;
  reply.snapshot_revision = info_.snapshot_revision;
  reply.snapshot_stamp_ns = info_.snapshot_stamp_ns;
  reply.oldest_receipt_ns = info_.oldest_receipt_ns;
  reply.snapshot_sequence = info_.snapshot_sequence;
  reply.pose_age_ns = info_.pose_age_ns;
  reply.pairs_evaluated = info_.pairs_evaluated;
  wire::set_name(reply.backend, info_.backend);
  reply.engine_ns = static_cast<std::uint64_t>(in_engine_.count());
  reply.server_ns = static_cast<std::uint64_t>(std::chrono::nanoseconds(worked_ - received_).count());
  return reply;
}

}  // namespace clearance
