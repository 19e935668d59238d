// The loop's answers to requests: each is checked, then answered at once or, a query, put among those under way.
#include <algorithm>
#include <array>
#include <cstring>

#include "error_frame.h"
#include "log_text.h"
#include "loop_task.h"
#include "scene_frame.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

/// What a pair is taken to cost, to tell when a query is due. A guess is enough: it only orders one client's queries.
constexpr auto kPairCost = std::chrono::microseconds(1);

/// What of a reply's records its query decides.
std::vector<std::byte> reply_records(const wire::PassedOver& passed_over) {
  std::vector<std::byte> records;
  if (!passed_over.empty())
    wire::append_record(records, static_cast<std::uint16_t>(wire::ReplyRecord::kIgnored), 0,
                        std::as_bytes(std::span(passed_over)));
  return records;
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
  copy_options(parts.options, q);
  q.scene_revision = scene_revision;
  return q;
}

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

void Loop::on_frame(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink> sink) {
  ++frames_;
  ReplySink& way_back = *sink;  // lives on in a Task if a query began
  guarded(way_back, header, [&] { handle(header, payload, sink); });
}

void Loop::handle(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink) {
  wire::check_header(header, payload.size());
  const auto type = static_cast<FrameType>(header.type);
  if (const Rights needed = right_for(type); needed & ~sink->rights())
    throw Refusal{ErrorCode::kForbidden, wire::type_name(header.type) + " needs the right \"" + rights_text(needed) +
                                             "\"; this client has " + rights_text(sink->rights())};
  if (type != FrameType::kQuery && type != FrameType::kPairs) payload = without_records(header, payload);
  switch (type) {
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
    case FrameType::kReload:
      wire::parse_empty(payload, header.type);
      return ask_reload(header, sink);
    case FrameType::kAddBody:
      return add_body(header, payload, sink);
    case FrameType::kRemoveBody:
      return remove_body(header, payload, sink);
    default:
      break;
  }
  throw Refusal{ErrorCode::kUnknownType, "frame: type " + wire::type_name(header.type) + " is no request"};
}

std::span<const std::byte> Loop::without_records(const FrameHeader& header, std::span<const std::byte> payload) {
  const wire::PayloadParts parts = wire::split_payload(header, payload);
  wire::PassedOver passed_over;
  wire::read_records(wire::type_name(header.type).c_str(), parts.records, passed_over,
                     [](const wire::RecordView&) { return false; });
  records_ignored_ += passed_over.size();
  return parts.body;
}

void Loop::check_room_for(std::uint64_t client) const {
  const auto found = waiting_per_client_.find(client);
  if (found != waiting_per_client_.end() && found->second.requests >= options_.max_waiting_per_client)
    throw Refusal{ErrorCode::kBusy, std::to_string(found->second.requests) +
                                        " queries of this client are under way already; ask again (--max-waiting)"};
}

std::uint64_t Loop::check_room_for_bytes(const ReplySink& sink, std::uint64_t bytes) const {
  const auto found = waiting_per_client_.find(sink.client());
  const std::uint64_t taken = (found == waiting_per_client_.end() ? 0 : found->second.bytes) + sink.unsent_bytes();
  if (taken && taken + bytes > options_.max_client_bytes)
    throw Refusal{ErrorCode::kBusy, "the requests and replies of this client under way take " + std::to_string(taken) +
                                        " bytes already; ask again (--max-client-mib)"};
  if (waiting_bytes_ && waiting_bytes_ + bytes > options_.max_waiting_bytes)
    throw Refusal{ErrorCode::kBusy, "the requests and replies under way take " + std::to_string(waiting_bytes_) +
                                        " bytes already; ask again"};
  return taken;
}

void Loop::start_query(const FrameHeader& header, std::span<const std::byte> payload,
                       std::unique_ptr<ReplySink>& sink) {
  ++queries_;
  check_room_for(sink->client());
  if (!payload.empty() && reinterpret_cast<std::uintptr_t>(payload.data()) % alignof(std::uint64_t)) {
    aligned_.resize((payload.size() + 7) / 8);
    std::memcpy(aligned_.data(), payload.data(), payload.size());
    payload = std::as_bytes(std::span(aligned_)).first(payload.size());
  }
  const wire::QueryParts parts = wire::parse_query(header, payload);
  const QueryOptions& o = parts.options;
  records_ignored_ += parts.passed_over.size();
  if (o.min_pose_stamp_ns != 0) check_wait_for(header, o);
  if (o.min_pose_stamp_ns != 0 && !engine_->poses_reach(o.wait_for, o.min_pose_stamp_ns)) {
    engine_->size(view_of(parts, header.scene_revision));  // what is wrong with it is said at once
    return hold_query(header, o, payload, sink);
  }
  begin_query(header, parts, payload.size(), sink, turn_began_);
}

void Loop::begin_query(const FrameHeader& header, const wire::QueryParts& parts, std::uint64_t payload_bytes,
                       std::unique_ptr<ReplySink>& sink, Clock::time_point received) {
  const std::uint64_t client = sink->client();
  QueryView query = view_of(parts, header.scene_revision);
  query.warm_slot = parts.options.warm ? client : 0;
  const auto begun = Clock::now();
  const QuerySize size = engine_->size(query);
  if (size.pairs && size.configurations > options_.max_pairs_per_query / size.pairs)
    throw Refusal{ErrorCode::kTooLarge, std::to_string(size.configurations) + " configurations of " +
                                            std::to_string(size.pairs) + " pairs are more than the " +
                                            std::to_string(options_.max_pairs_per_query) +
                                            " that one query may ask about (--max-pairs): split it"};
  std::vector<std::byte> records = reply_records(parts.passed_over);
  const std::uint64_t bytes = kColumnsBegin + wire::columns_bytes(size.rows, size.fields) + records.size();
  if (query.reduce != Reduce::kWithin) check_reply_size(size.rows, bytes, parts.options.max_reply_bytes);
  // The engine keeps the configurations and the pairs, unless these are the scene's whole table.
  const bool whole_table = parts.header.all_pairs && parts.bodies.size() == 0;
  std::uint64_t held = bytes + payload_bytes + (whole_table ? 0 : size.pairs * sizeof(BodyPair));
  Usage& usage = waiting_per_client_[client];
  const std::uint64_t taken = check_room_for_bytes(*sink, held);
  // Warm state has what is left, and makes way: without it an answer takes longer, and no more.
  const std::uint64_t left = options_.max_client_bytes - std::min(options_.max_client_bytes, taken + held);
  std::uint64_t warm = Engine::warm_bytes(query, size);
  if (warm > left) {
    warm = query.warm_slot = 0;
    ++counter("queries.cold");
  }
  held += warm;
  if (warm == 0 && left < Engine::kMostWarmBytes)
    engine_->trim_warm(client, left);  // else the query takes what was left

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
  const std::chrono::nanoseconds in_engine = Clock::now() - begun;
  auto task = std::make_unique<Task>(std::move(sink), header, engine_, std::move(job));
  task->frame = frame;
  task->own = std::move(own);
  task->records = std::move(records);
  task->held_bytes = held;
  task->max_reply_bytes = parts.options.max_reply_bytes;
  task->reduce = query.reduce;
  task->format = query.format;
  task->received = received;
  task->due = begun + kPairCost * std::min<std::uint64_t>(size.configurations * size.pairs, 1u << 30);
  task->in_engine = in_engine;
  ++usage.requests;
  usage.bytes += held;
  waiting_bytes_ += held;
  fresh_.push(client, std::move(task));
}

void Loop::answer_pairs(const FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink) {
  std::vector<std::byte> copy(payload.begin(), payload.end());  // aligned
  const wire::QueryParts parts = wire::parse_query(header, copy);
  records_ignored_ += parts.passed_over.size();
  const QueryView query = view_of(parts, header.scene_revision);
  const std::vector<BodyPair> pairs = engine_->pairs(query);
  wire::PairsHeader table;
  table.scene_revision = header.scene_revision ? header.scene_revision : engine_->scene_revision();
  table.count = pairs.size();
  std::vector<std::byte> reply(sizeof table + pairs.size() * sizeof(BodyPair));
  std::memcpy(reply.data(), &table, sizeof table);
  if (!pairs.empty()) std::memcpy(reply.data() + sizeof table, pairs.data(), pairs.size() * sizeof(BodyPair));
  answer(sink, header, FrameType::kPairTable, reply);
}

void Loop::check_scene(const FrameHeader& header, std::span<const std::uint32_t> ids, bool with_parents) const {
  if (header.scene_revision && !engine_->still_means(header.scene_revision, ids, with_parents))
    throw Refusal{ErrorCode::kWrongScene, "the request is for scene revision " + std::to_string(header.scene_revision) +
                                              ", the daemon's is " + std::to_string(engine_->scene_revision()) +
                                              ": fetch the scene again"};
}

void Loop::check_wait_for(const FrameHeader& header, const QueryOptions& query) const {
  if (query.wait_for != kEveryBody) check_scene(header, std::array{query.wait_for});
}

void Loop::set_poses(const FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink) {
  const wire::PosesParts parts = wire::parse_poses(payload);
  poses_.resize(parts.poses.size());
  ids_.resize(parts.poses.size());
  for (std::uint64_t i = 0; i < parts.poses.size(); ++i) {
    const wire::PoseRecord record = parts.poses[i];
    poses_[i] = {record.body, pose_of(record.pose)};
    ids_[i] = record.body;
  }
  check_scene(header, ids_, true);
  const auto result = result_of(on_poses(poses_, parts.header.stamp_ns, parts.header.sequence, sink.client()),
                                engine_->scene_revision());
  answer(sink, header, FrameType::kPosesDone, std::as_bytes(std::span(&result, 1)));
}

PoseUpdateResult Loop::on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                                std::uint64_t publisher) {
  const PoseUpdateResult done = engine_->set_poses(poses, stamp_ns, sequence, publisher);
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
  check_scene(header, std::array{record.child}, true);
  if (record.parent != kNone) check_scene(header, std::array{record.parent});
  const Pose X_pc = pose_of(record.pose);
  const bool is_behind = header.scene_revision && header.scene_revision != engine_->scene_revision();
  const auto done = engine_->attach(record.child, record.parent, record.has_pose ? &X_pc : nullptr);
  ++counter("attachments");
  poses_changed_ = true;
  // Who knew the scene before this knows the one after it; who was behind goes on with the ids that it knows.
  const auto result = result_of(done, is_behind ? header.scene_revision : engine_->scene_revision());
  answer(sink, header, FrameType::kPosesDone, std::as_bytes(std::span(&result, 1)));
}

std::vector<std::pair<std::string, std::uint64_t>> Loop::all_counters() const {
  std::vector<std::pair<std::string, std::uint64_t>> all;
  all.emplace_back("uptime_s", std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - started_).count());
  all.emplace_back("queries.waiting", waiting());
  all.emplace_back("queries.held", held_.size());
  all.emplace_back("requests.waiting", waiting() + held_.size() + scene_waiters_.size());
  all.insert(all.end(), counters_.begin(), counters_.end());
  const auto engine = engine_->stats();
  all.insert(all.end(), engine.begin(), engine.end());
  return all;
}

std::vector<std::byte> Loop::stats_payload() const {
  std::vector<std::byte> payload;
  for (const auto& [name, value] : all_counters()) {
    wire::CounterRecord record;
    wire::set_name(record.name, name);
    record.value = value + (name == "requests.waiting");  // with the one that asks for this
    wire::append(payload, record);
  }
  return payload;
}

void Loop::hand_out_figures() {
  Figures figures{all_counters(), error_log_.entries()};
  {
    const std::lock_guard lock(figures_mutex_);
    figures_wanted_ = false;
    figures_ = std::move(figures);
  }
  figures_there_.notify_all();
}

std::optional<Loop::Figures> Loop::read_figures(std::chrono::nanoseconds patience) {
  std::unique_lock lock(figures_mutex_);
  figures_.reset();
  figures_wanted_ = true;
  wake();
  figures_there_.wait_for(lock, patience, [this] { return figures_.has_value(); });
  return figures_;
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
  const auto header = wire::make_reply_header(request, type, payload.size(), engine_->scene_revision());
  std::memcpy(frame, &header, sizeof header);
  if (!payload.empty()) std::memcpy(frame + sizeof header, payload.data(), payload.size());
  sink.publish(bytes);
  ++replies_;
}

void Loop::refuse(ReplySink& sink, const FrameHeader& request, const Refusal& refusal) {
  ++counter("errors");
  error_log_.note(std::string(wire::error_name(refusal.code)), refusal.text);
  ++counter("errors." + std::string(wire::error_name(refusal.code)));
  spdlog::debug("event=refused client={} request={} error=\"{}\"", sink.client(), wire::type_name(request.type),
                log_text(refusal.text));
  try {
    if (!send_error(sink, request, engine_->scene_revision(), refusal.code, refusal.text, refusal.needed_bytes))
      ++counter("errors.unsent");
  } catch (const std::exception& failure) {
    ++counter("errors.unsent");
    spdlog::warn("event=error_unsent error=\"{}\" cause=\"{}\"", log_text(refusal.text), log_text(failure.what()));
  }
}

}  // namespace clearance
