#include "loop.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>

#include "client/wire.h"
#include "error_frame.h"
#include "scene_frame.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

/// First slices given out before one of the long queries gets its turn.
constexpr int kFreshBeforeLong = 4;
/// Wake-ups that brought nothing, after which a descriptor that stays readable (a listener without descriptors left,
/// say) may no longer keep the loop from sleeping.
constexpr int kWakesForNothing = 100;

/// What a pair is taken to cost, to tell when a query is due. A guess is enough: it only orders one client's queries.
constexpr auto kPairCost = std::chrono::microseconds(1);

constexpr std::uint64_t kColumnsBegin = sizeof(FrameHeader) + sizeof(wire::ReplyHeader);
static_assert(kColumnsBegin % wire::kColumnAlignment == 0);

ErrorCode code_of(QueryErrorCode code) {
  return static_cast<ErrorCode>(code);
}
static_assert(static_cast<int>(QueryErrorCode::kBadQuery) == static_cast<int>(ErrorCode::kBadQuery) &&
              static_cast<int>(QueryErrorCode::kWrongScene) == static_cast<int>(ErrorCode::kWrongScene) &&
              static_cast<int>(QueryErrorCode::kTooLarge) == static_cast<int>(ErrorCode::kTooLarge) &&
              static_cast<int>(QueryErrorCode::kNotSupported) == static_cast<int>(ErrorCode::kNotSupported));

std::string scheme_of(const std::string& url) {
  return url.substr(0, url.find(':'));
}

/// The engine's view of a query whose payload begins on a multiple of 8.
QueryView view_of(const wire::QueryParts& parts, std::uint64_t scene_revision) {
  const wire::QueryHeader& h = parts.header;
  static_assert(sizeof(BodyPair) == sizeof(wire::PairRecord) && sizeof(Pose) == sizeof(wire::ConfigurationRecord));
  QueryView q;
  q.pairs = {reinterpret_cast<const BodyPair*>(parts.pairs.data()), static_cast<std::size_t>(parts.pairs.size())};
  q.bodies = {reinterpret_cast<const std::uint32_t*>(parts.bodies.data()),
              static_cast<std::size_t>(parts.bodies.size())};
  q.configurations = {reinterpret_cast<const Pose*>(parts.configurations.data()),
                      static_cast<std::size_t>(parts.configurations.size())};
  q.all_pairs = h.all_pairs;
  q.configuration_count = h.configuration_count;
  q.max_distance = h.max_distance;
  q.abs_tol = h.abs_tol;
  q.rel_tol = h.rel_tol;
  q.precision = static_cast<Precision>(h.precision);
  q.signed_distance = h.signed_distance;
  q.reduce = static_cast<Reduce>(h.reduce);
  q.format = static_cast<Format>(h.format);
  q.fields = h.fields;
  q.max_results = h.max_results;
  q.max_pose_age_ns = h.max_pose_age_ns;
  q.scene_revision = scene_revision;
  return q;
}

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
  for (int f = 0; f < kFieldCount; ++f) {
    if (!(fields >> f & 1)) continue;
    const std::uint64_t used = rows * kFieldBytes[f];
    std::byte* end = columns + wire::column_offset(rows, fields, Field(1u << f)) + used;
    std::memset(end, 0, (wire::kColumnAlignment - used % wire::kColumnAlignment) % wire::kColumnAlignment);
  }
}

}  // namespace

/// Why a request is not answered.
struct Loop::Refusal {
  ErrorCode code;
  std::string text;
  std::uint64_t needed_bytes = 0;
};

/// A query under way.
struct Loop::Task {
  Task(std::unique_ptr<ReplySink> s, const FrameHeader& r, std::shared_ptr<Engine> e, Job j)
      : sink(std::move(s)), request(r), engine(std::move(e)), job(std::move(j)) {}

  std::unique_ptr<ReplySink> sink;
  FrameHeader request;
  std::shared_ptr<Engine> engine;  // the job's, though the loop may have another one by now
  Job job;
  std::byte* frame = nullptr;  // the sink's room, or `own`
  AlignedBytes own;            // where the sink has no room for the most that may come back
  std::uint64_t frame_bytes = 0;
  Reduce reduce = Reduce::kNone;
  Format format = Format::kFull;
  Clock::time_point received, due;
  std::chrono::nanoseconds in_engine{0};
};

bool Loop::DueFirst::operator()(const TaskPtr& a, const TaskPtr& b) const {
  return a->due < b->due;
}

Loop::Loop(Engine& engine, const Options& options) : Loop(std::shared_ptr<Engine>(std::shared_ptr<Engine>(), &engine), options) {}

Loop::Loop(std::shared_ptr<Engine> engine, const Options& options)
    : engine_(std::move(engine)), options_(options), started_(Clock::now()), next_tick_(started_) {
  for (int i = 0; i < kLatencyBuckets; ++i)
    latency_[i] = &counter("latency_us." + (i + 1 < kLatencyBuckets ? std::to_string(1u << i) : "more"));
  wake_fd_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_fd_ < 0) throw std::runtime_error(std::string("eventfd: ") + std::strerror(errno));
}

Loop::~Loop() {
  close(wake_fd_);
}

void Loop::add(std::unique_ptr<Transport> transport) {
  transport_frames_.push_back(&counter(scheme_of(transport->url()) + ".frames"));
  transports_.push_back(std::move(transport));
}

void Loop::stop() noexcept {
  stopping_ = true;
  wake();
}

void Loop::wake() noexcept {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_fd_, &one, sizeof one);
}

void Loop::reload_by(Reloader::Make make) {
  reloader_ = std::make_unique<Reloader>(std::move(make), [this] { wake(); });
}

void Loop::reload() noexcept {
  if (!reloader_) return;
  reloader_->ask();
  wake();
}

void Loop::take_new_engine() {
  std::optional<Reloader::Outcome> outcome = reloader_->poll();
  if (!outcome) return;
  if (!outcome->engine) {
    ++counter("reloads.failed");
    spdlog::error("event=reload_failed seconds={:.3f} error=\"{}\"", outcome->seconds, outcome->error);
    return;
  }
  outcome->engine->take_poses(*engine_);
  engine_ = std::move(outcome->engine);
  poses_changed_ = true;
  ++counter("reloads");
  spdlog::info("event=reloaded bodies={} revision={:016x} seconds={:.3f}", engine_->scene().bodies().size(), engine_->scene_revision(),
               outcome->seconds);
}

void Loop::run() {
  Clock::time_point last_work = Clock::now();
  while (!stopping_) {
    if (turn()) {
      last_work = Clock::now();
      wakes_for_nothing_ = 0;
    } else if (Clock::now() - last_work > options_.spin) {
      sleep();
    }
  }
}

bool Loop::turn() {
  if (reloader_) take_new_engine();
  bool worked = poll_transports();
  if (poses_changed_ || Clock::now() >= next_tick_) tick();
  worked |= work_for_a_slice();
  return worked;
}

bool Loop::poll_transports() {
  int frames = 0;
  for (std::size_t i = 0; i < transports_.size(); ++i) {
    try {
      const int taken = transports_[i]->poll(*this);
      *transport_frames_[i] += static_cast<std::uint64_t>(taken);
      frames += taken;
    } catch (const std::exception& error) {
      ++counter("errors.transport");
      if (const auto now = Clock::now(); now >= next_warning_) {
        next_warning_ = now + std::chrono::seconds(1);
        spdlog::warn("event=poll_failed url={} error=\"{}\"", transports_[i]->url(), error.what());
      }
    }
  }
  return frames > 0;
}

void Loop::tick() {
  poses_changed_ = false;
  const auto now = Clock::now();
  if (now >= next_tick_) {
    next_tick_ = now + options_.tick;
    const auto gone = [](const TaskPtr& task) { return !task->sink->alive(); };
    const auto drop = [this](const TaskPtr& task) { forget(*task), ++counter("queries.dropped"); };
    fresh_.remove_if(gone, drop);
    long_.remove_if(gone, drop);
  }
  for (const auto& transport : transports_) {
    try {
      transport->tick(*this);
    } catch (const std::exception& error) {
      ++counter("errors.transport");
      spdlog::warn("event=tick_failed url={} error=\"{}\"", transport->url(), error.what());
    }
  }
}

void Loop::sleep() {
  // poll() and not epoll: descriptors come and go with clients, and one that was closed and is used again for another
  // would silently be missing from an epoll set. For tens of descriptors it takes no longer.
  std::vector<pollfd> fds{{wake_fd_, POLLIN, 0}};
  for (const auto& transport : transports_)
    for (const int fd : transport->descriptors()) fds.push_back({fd, POLLIN, 0});

  std::size_t prepared = 0;
  bool work = false;
  while (prepared < transports_.size() && !work) work = transports_[prepared++]->prepare_sleep();
  if (!work && !stopping_) {
    const auto left = std::max<std::chrono::nanoseconds>(next_tick_ - Clock::now(), std::chrono::nanoseconds(0));
    timespec timeout{left.count() / 1'000'000'000, left.count() % 1'000'000'000};
    // A descriptor that stays readable though there is nothing to take is not listened to for a while.
    const bool nagged = ++wakes_for_nothing_ > kWakesForNothing;
    if (nagged) timeout = {0, std::min<long>(1'000'000, timeout.tv_sec ? 1'000'000 : timeout.tv_nsec)};
    ++counter("loop.sleeps");
    const int ready = ppoll(fds.data(), nagged ? 1 : fds.size(), &timeout, nullptr);
    if (ready == 0 && !nagged) wakes_for_nothing_ = 0;
  }
  for (std::size_t i = 0; i < prepared; ++i) transports_[i]->finish_sleep();
}

// --- slices
// -----------------------------------------------------------------------------------------------------------

Loop::TaskPtr Loop::next_task() {
  const bool take_long = fresh_.empty() || (!long_.empty() && fresh_in_a_row_ >= kFreshBeforeLong);
  fresh_in_a_row_ = take_long ? 0 : fresh_in_a_row_ + 1;
  return take_long ? long_.pop() : fresh_.pop();
}

bool Loop::work_for_a_slice() {
  if (!waiting()) return false;
  const auto begin = Clock::now();
  auto now = begin;
  do {
    TaskPtr task = next_task();
    if (!task->sink->alive()) {
      forget(*task);
      ++counter("queries.dropped");
      continue;
    }
    bool done = false, failed = true;
    guarded(*task->sink, task->request, [&] {
      done = task->job.advance(options_.slice);
      failed = false;
    });
    const auto after = Clock::now();
    task->in_engine += after - now;
    now = after;
    if (done) guarded(*task->sink, task->request, [&] { finish(*task); });
    if (done || failed) {
      forget(*task);
    } else {
      const std::uint64_t client = task->sink->client();
      long_.push(client, std::move(task));
    }
  } while (waiting() && now - begin < options_.slice);
  return true;
}

void Loop::forget(const Task& task) {
  waiting_bytes_ -= task.frame_bytes;
  const auto client = waiting_per_client_.find(task.sink->client());
  if (--client->second == 0) waiting_per_client_.erase(client);
}

void Loop::finish(Task& task) {
  const QuerySize& size = task.job.size();
  const ReplyInfo& info = task.job.info();
  std::byte* frame = task.frame;
  if (info.rows < size.rows) close_up_columns(frame + kColumnsBegin, size.fields, size.rows, info.rows);
  clear_gaps(frame + kColumnsBegin, size.fields, info.rows);
  const std::uint64_t bytes = kColumnsBegin + wire::columns_bytes(info.rows, size.fields);
  if (task.own) {
    frame = task.sink->reserve(bytes);
    if (!frame)
      throw Refusal{ErrorCode::kTooLarge,
                    "the reply of " + std::to_string(info.rows) + " rows needs " + std::to_string(bytes) +
                        " bytes, more than this client has room for",
                    bytes};
    std::memcpy(frame + kColumnsBegin, task.own.get() + kColumnsBegin, bytes - kColumnsBegin);
  }

  wire::ReplyHeader reply;
  reply.rows = info.rows;
  reply.total = info.total;
  reply.configurations = size.configurations;
  reply.pairs = size.pairs;
  reply.fields = size.fields;
  reply.reduce = static_cast<std::uint8_t>(task.reduce);
  reply.format = static_cast<std::uint8_t>(task.format);
  reply.scene_revision = info.scene_revision;
  reply.snapshot_revision = info.snapshot_revision;
  reply.snapshot_stamp_ns = info.snapshot_stamp_ns;
  reply.oldest_receipt_ns = info.oldest_receipt_ns;
  reply.pairs_evaluated = info.pairs_evaluated;
  wire::set_name(reply.backend, info.backend);
  reply.engine_ns = static_cast<std::uint64_t>(task.in_engine.count());
  const auto header = wire::make_header(FrameType::kReply, task.request.request_id, bytes - sizeof(FrameHeader),
                                        info.scene_revision, task.request.client_id);
  std::memcpy(frame, &header, sizeof header);
  reply.server_ns = static_cast<std::uint64_t>(std::chrono::nanoseconds(Clock::now() - task.received).count());
  std::memcpy(frame + sizeof header, &reply, sizeof reply);
  task.sink->publish(bytes);
  ++answered_;
  const std::uint64_t us = (reply.server_ns + 999) / 1000;
  ++*latency_[std::min<int>(std::bit_width(us > 0 ? us - 1 : 0), kLatencyBuckets - 1)];
  rows_ += info.rows;
}

// --- requests
// ---------------------------------------------------------------------------------------------------------

template <class Work>
void Loop::guarded(ReplySink& sink, const FrameHeader& request, Work work) {
  try {
    work();
    return;
  } catch (const Refusal& refusal) {
    refuse(sink, request, refusal);
  } catch (const wire::WireError& error) {
    refuse(sink, request, {error.code, error.what()});
  } catch (const QueryError& error) {
    refuse(sink, request, {code_of(error.code), error.what()});
  } catch (const std::bad_alloc&) {
    refuse(sink, request, {ErrorCode::kTooLarge, "the daemon has no memory for this request"});
  } catch (const std::exception& error) {
    spdlog::error("event=internal_error request={} error=\"{}\"", wire::type_name(request.type), error.what());
    refuse(sink, request, {ErrorCode::kInternal, std::string("internal error of the daemon: ") + error.what()});
  }
}

void Loop::on_frame(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink> sink) {
  ++frames_;
  ReplySink& way_back = *sink;  // lives on in a Task if a query began
  guarded(way_back, header, [&] { handle(header, payload, sink); });
}

void Loop::handle(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink) {
  wire::check_header(header, payload.size());
  switch (static_cast<FrameType>(header.type)) {
    case FrameType::kPing:
      return answer(*sink, header, FrameType::kPong, payload);
    case FrameType::kDescribe:
      wire::parse_empty(payload, header.type);
      return answer(*sink, header, FrameType::kScene, scene_payload(*engine_));
    case FrameType::kQuery:
      return start_query(header, payload, sink);
    case FrameType::kPairs:
      return answer_pairs(header, payload, *sink);
    case FrameType::kSetPoses:
      return set_poses(header, payload, *sink);
    case FrameType::kAttach:
      return attach(header, payload, *sink);
    case FrameType::kGetStates:
      wire::parse_empty(payload, header.type);
      return answer(*sink, header, FrameType::kBodyStates, states_payload(*engine_));
    case FrameType::kGetStats:
      wire::parse_empty(payload, header.type);
      return answer(*sink, header, FrameType::kStats, stats_payload());
    default:
      break;
  }
  throw Refusal{ErrorCode::kUnknownType, "frame: type " + wire::type_name(header.type) + " is no request"};
}

void Loop::start_query(const FrameHeader& header, std::span<const std::byte> payload,
                       std::unique_ptr<ReplySink>& sink) {
  const auto received = Clock::now();
  ++queries_;
  const std::uint64_t client = sink->client();
  if (const auto found = waiting_per_client_.find(client);
      found != waiting_per_client_.end() && found->second >= options_.max_waiting_per_client)
    throw Refusal{ErrorCode::kBusy,
                  std::to_string(found->second) + " queries of this client are under way already; ask again"};
  if (reinterpret_cast<std::uintptr_t>(payload.data()) % alignof(std::uint64_t)) {
    aligned_.resize((payload.size() + 7) / 8);
    std::memcpy(aligned_.data(), payload.data(), payload.size());
    payload = std::as_bytes(std::span(aligned_)).first(payload.size());
  }
  const wire::QueryParts parts = wire::parse_query(payload);
  QueryView query = view_of(parts, header.scene_revision);
  query.warm_slot = parts.header.warm ? client : 0;
  const QuerySize size = engine_->size(query);
  const std::uint64_t bytes = kColumnsBegin + wire::columns_bytes(size.rows, size.fields);
  if (waiting_bytes_ && waiting_bytes_ + bytes > options_.max_waiting_bytes)
    throw Refusal{ErrorCode::kBusy,
                  "the replies under way take " + std::to_string(waiting_bytes_) + " bytes already; ask again"};

  AlignedBytes own;
  std::byte* frame = sink->reserve(bytes);
  if (!frame && query.reduce == Reduce::kWithin) {  // what comes back may well fit
    own = aligned_bytes(bytes);
    frame = own.get();
  }
  if (!frame)
    throw Refusal{ErrorCode::kTooLarge,
                  "the reply of " + std::to_string(size.rows) + " rows needs " + std::to_string(bytes) +
                      " bytes, more than this client has room for",
                  bytes};
  Job job = engine_->start(query, reply_view_over(frame + kColumnsBegin, size.rows, size.fields));
  auto task = std::make_unique<Task>(std::move(sink), header, engine_, std::move(job));
  task->frame = frame;
  task->own = std::move(own);
  task->frame_bytes = bytes;
  task->reduce = query.reduce;
  task->format = query.format;
  task->received = received;
  task->due = received + kPairCost * std::min<std::uint64_t>(size.configurations * size.pairs, 1u << 30);
  task->in_engine = Clock::now() - received;
  ++waiting_per_client_[client];
  waiting_bytes_ += bytes;
  fresh_.push(client, std::move(task));
}

void Loop::answer_pairs(const FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink) {
  std::vector<std::byte> copy(payload.begin(), payload.end());  // aligned
  const QueryView query = view_of(wire::parse_query(copy, false), header.scene_revision);
  const std::vector<BodyPair> pairs = engine_->pairs(query);
  wire::PairsHeader table;
  table.scene_revision = engine_->scene_revision();
  table.count = pairs.size();
  std::vector<std::byte> reply(sizeof table + pairs.size() * sizeof(BodyPair));
  std::memcpy(reply.data(), &table, sizeof table);
  if (!pairs.empty()) std::memcpy(reply.data() + sizeof table, pairs.data(), pairs.size() * sizeof(BodyPair));
  answer(sink, header, FrameType::kPairTable, reply);
}

void Loop::check_scene(const FrameHeader& header) const {
  if (header.scene_revision && header.scene_revision != engine_->scene_revision())
    throw Refusal{ErrorCode::kWrongScene, "the request is for scene revision " + std::to_string(header.scene_revision) +
                                              ", the daemon's is " + std::to_string(engine_->scene_revision()) +
                                              ": fetch the scene again"};
}

namespace {

wire::PosesResult result_of(const PoseUpdateResult& done, std::uint64_t scene_revision) {
  wire::PosesResult result;
  result.revision = done.revision;
  result.scene_revision = scene_revision;
  result.applied = done.applied;
  result.bad = done.bad;
  result.unknown = done.unknown;
  result.fixed = done.fixed;
  return result;
}

Pose pose_of(const double (&seven)[7]) {
  Pose pose;
  std::memcpy(&pose, seven, sizeof pose);
  return pose;
}

}  // namespace

void Loop::set_poses(const FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink) {
  const wire::PosesParts parts = wire::parse_poses(payload);
  check_scene(header);
  poses_.resize(parts.poses.size());
  for (std::uint64_t i = 0; i < parts.poses.size(); ++i) {
    const wire::PoseRecord record = parts.poses[i];
    poses_[i] = {record.body, pose_of(record.pose)};
  }
  const auto result = result_of(on_poses(poses_, parts.header.stamp_ns), engine_->scene_revision());
  answer(sink, header, FrameType::kPosesDone, std::as_bytes(std::span(&result, 1)));
}

PoseUpdateResult Loop::on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns) {
  const PoseUpdateResult done = engine_->set_poses(poses, stamp_ns);
  ++counter("poses.batches");
  counter("poses.applied") += done.applied;
  counter("poses.bad") += done.bad;
  counter("poses.unknown") += done.unknown;
  counter("poses.fixed") += done.fixed;
  poses_changed_ = true;
  return done;
}

void Loop::attach(const FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink) {
  const wire::AttachRecord record = wire::parse_attach(payload);
  check_scene(header);
  const Pose X_pc = pose_of(record.pose);
  const auto done = engine_->attach(record.child, record.parent, record.has_pose ? &X_pc : nullptr);
  ++counter("attachments");
  poses_changed_ = true;
  const auto result = result_of(done, engine_->scene_revision());
  answer(sink, header, FrameType::kPosesDone, std::as_bytes(std::span(&result, 1)));
}

std::vector<std::byte> Loop::stats_payload() const {
  std::vector<std::byte> payload;
  const auto add = [&payload](const std::string& name, std::uint64_t value) {
    wire::CounterRecord record;
    wire::set_name(record.name, name);
    record.value = value;
    wire::append(payload, record);
  };
  add("uptime_s",
      static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - started_).count()));
  add("queries.waiting", waiting());
  for (const auto& [name, value] : counters_) add(name, value);
  for (const auto& [name, value] : engine_->stats()) add(name, value);
  return payload;
}

void Loop::answer(ReplySink& sink, const FrameHeader& request, FrameType type, std::span<const std::byte> payload) {
  const std::uint64_t bytes = sizeof(FrameHeader) + payload.size();
  if (bytes > wire::kMaxFrameBytes)
    throw Refusal{ErrorCode::kTooLarge,
                  "the reply needs " + std::to_string(bytes) + " bytes, more than a frame may have", bytes};
  std::byte* frame = sink.reserve(bytes);
  if (!frame)
    throw Refusal{ErrorCode::kTooLarge,
                  "the reply needs " + std::to_string(bytes) + " bytes, more than this client has room for", bytes};
  const auto header =
      wire::make_header(type, request.request_id, payload.size(), engine_->scene_revision(), request.client_id);
  std::memcpy(frame, &header, sizeof header);
  if (!payload.empty()) std::memcpy(frame + sizeof header, payload.data(), payload.size());
  sink.publish(bytes);
}

void Loop::refuse(ReplySink& sink, const FrameHeader& request, const Refusal& refusal) {
  ++counter("errors");
  ++counter("errors." + std::string(wire::error_name(refusal.code)));
  spdlog::debug("event=refused client={} request={} error=\"{}\"", sink.client(), wire::type_name(request.type),
                refusal.text);
  try {
    if (!send_error(sink, request, engine_->scene_revision(), refusal.code, refusal.text, refusal.needed_bytes))
      ++counter("errors.unsent");
  } catch (const std::exception& failure) {
    ++counter("errors.unsent");
    spdlog::warn("event=error_unsent error=\"{}\" cause=\"{}\"", refusal.text, failure.what());
  }
}

}  // namespace clearance
