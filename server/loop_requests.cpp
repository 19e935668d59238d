// The loop's answers to requests: each is checked, then answered at once or handed to whoever answers it later.
#include <algorithm>
#include <array>
#include <cstring>

#include "loop.h"
#include "running_query.h"
#include "scene_check.h"
#include "scene_frame.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

/// What a pair is taken to cost, to tell when a query is due. A guess is enough: it only orders one client's queries.
constexpr auto kPairCost = std::chrono::microseconds(1);

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

template <class Record>
std::span<const std::byte> bytes_of(const Record& record) {
  return std::as_bytes(std::span(&record, 1));
}

}  // namespace

void Loop::on_frame(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink> sink) {
  ++stats_.frames;
  ReplySink& way_back = *sink;  // lives on with the request if that is answered later
  answers_.guard(way_back, header, [&] { handle(header, payload, sink); });
}

void Loop::handle(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink) {
  wire::check_header(header, payload.size());
  const auto type = static_cast<FrameType>(header.type);
  if (const Rights needed = right_for(type); needed & ~sink->rights())
    throw Refusal{ErrorCode::kForbidden, wire::type_name(header.type) + " needs the right \"" + rights_text(needed) +
                                             "\"; this client has " + rights_text(sink->rights())};
  if (type != FrameType::kQuery && type != FrameType::kPairs) payload = without_records(header, payload);
  const auto reply = [&](FrameType with, std::span<const std::byte> bytes) {
    answers_.reply(*sink, header, with, bytes);
  };
  const auto is_empty = [&] { wire::parse_empty(payload, header.type); };
  switch (type) {
    case FrameType::kPing:
      return reply(FrameType::kPong, payload);
    case FrameType::kDescribe:
      is_empty();
      return reply(FrameType::kScene, scene_payload(*engine_));
    case FrameType::kQuery:
      return start_query(header, payload, sink);
    case FrameType::kPairs:
      return reply(FrameType::kPairTable, pair_table(header, payload));
    case FrameType::kSetPoses:
      return reply(FrameType::kPosesDone, bytes_of(set_poses(header, payload, sink->client())));
    case FrameType::kAttach:
      return reply(FrameType::kPosesDone, bytes_of(attach(header, payload)));
    case FrameType::kGetStates:
      is_empty();
      return reply(FrameType::kBodyStates, states_payload(*engine_));
    case FrameType::kGetStats:
      is_empty();
      return reply(FrameType::kStats, stats_payload());
    case FrameType::kReload:
      is_empty();
      return scenes_.ask_reload(header, sink);
    case FrameType::kAddBody:
      return scenes_.add_body(header, payload, sink);
    case FrameType::kRemoveBody:
      return scenes_.remove_body(header, payload, sink);
    default:
      break;
  }
  throw Refusal{ErrorCode::kUnknownType, "frame: type " + wire::type_name(header.type) + " is no request"};
}

/// The payload of a request of which no record but the epoch is known. Throws WireError if one of them is required.
std::span<const std::byte> Loop::without_records(const FrameHeader& header, std::span<const std::byte> payload) {
  const wire::PayloadParts parts = wire::split_payload(header, payload);
  wire::PassedOver passed_over;
  const std::uint64_t epoch = wire::read_records(wire::type_name(header.type).c_str(), parts.records, passed_over,
                                                 [](const wire::RecordView&) { return false; });
  stats_.records_ignored += passed_over.size();
  check_epoch(static_cast<FrameType>(header.type), epoch);
  return parts.body;
}

/// Whether a request is for this run of the daemon. What was sent to another one - poses, attachments, bodies - is not
/// here, so an answer would be of other poses than the client thinks. \param named 0: the request names none
void Loop::check_epoch(FrameType type, std::uint64_t named) const {
  if (named == epoch()) return;
  if (named)
    throw Refusal{ErrorCode::kNewEpoch,
                  "the daemon was started anew, or is another one, since this client's first contact: poses, "
                  "attachments and bodies that clients had sent are gone; acknowledge its epoch, and send them again"};
  const bool is_harmless = type == FrameType::kPing || type == FrameType::kDescribe || type == FrameType::kGetStats;
  if (options_.require_epoch && !is_harmless)
    throw Refusal{ErrorCode::kNewEpoch,
                  wire::type_name(static_cast<std::uint16_t>(type)) + " names no epoch (--require-epoch)"};
}

/// A payload whose first byte lies on a multiple of 8: this one, or a copy that is good until the next call.
std::span<const std::byte> Loop::aligned(std::span<const std::byte> payload) {
  if (payload.empty() || reinterpret_cast<std::uintptr_t>(payload.data()) % alignof(std::uint64_t) == 0) return payload;
  aligned_.resize((payload.size() + 7) / 8);
  std::memcpy(aligned_.data(), payload.data(), payload.size());
  return std::as_bytes(std::span(aligned_)).first(payload.size());
}

void Loop::start_query(const FrameHeader& header, std::span<const std::byte> payload,
                       std::unique_ptr<ReplySink>& sink) {
  ++stats_.queries;
  quotas_.check_requests(sink->client());
  payload = aligned(payload);
  const wire::QueryParts parts = wire::parse_query(header, payload);
  check_epoch(FrameType::kQuery, parts.epoch);
  const QueryOptions& asked = parts.options;
  stats_.records_ignored += parts.passed_over.size();
  if (asked.min_pose_stamp_ns == 0 || HeldQueries::poses_are_there(*engine_, header, asked))
    return begin_query(header, parts, payload.size(), sink, turn_began_);
  engine_->size(view_of(parts, header.scene_revision));  // what is wrong with it is said at once
  held_.hold(header, asked, payload, sink, quotas_, *engine_, turn_began_);
  ++stats_["queries.held_back"];
}

void Loop::begin_held(HeldQuery held) {
  std::unique_ptr<ReplySink> sink = std::move(held.asked.sink);
  ReplySink& way_back = *sink;  // lives on with the query
  held.asked.share.give_back();
  answers_.guard(way_back, held.asked.header, [&] {
    if (!HeldQueries::poses_are_there(*engine_, held.asked.header, held.query)) throw poses_late(held.query, true);
    const auto payload = held.payload();
    begin_query(held.asked.header, wire::parse_query(held.asked.header, payload), payload.size(), sink, held.received);
  });
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
  // The engine keeps the configurations and the pairs, unless these are the scene's whole table.
  const bool whole_table = parts.header.all_pairs && parts.bodies.size() == 0;
  std::vector<std::byte> records = answers_.records(header, parts.passed_over);
  const std::uint64_t reply_bytes = kColumnsBegin + wire::columns_bytes(size.rows, size.fields) + records.size();
  if (query.reduce != Reduce::kWithin) check_reply_size(size.rows, reply_bytes, parts.options.max_reply_bytes);
  std::uint64_t bytes = reply_bytes + payload_bytes + (whole_table ? 0 : size.pairs * sizeof(BodyPair));
  const std::uint64_t left = quotas_.check_bytes(client, bytes, sink->unsent_bytes());
  // Warm state has what is left, and makes way: without it an answer takes longer, and no more.
  std::uint64_t warm = Engine::warm_bytes(query, size);
  if (warm > left) {
    warm = query.warm_slot = 0;
    ++stats_["queries.cold"];
  }
  if (warm == 0 && left < Engine::kMostWarmBytes)
    engine_->trim_warm(client, left);  // else the query takes what was left
  bytes += warm;

  Quotas::Share share = quotas_.take(client, bytes);
  ReplyRoom room = reserve_room(*sink, size, query.reduce, records.size());
  Job job = engine_->start(query, reply_view_over(room.frame + kColumnsBegin, size.rows, size.fields));
  const std::uint64_t pairs = std::min<std::uint64_t>(size.configurations * size.pairs, 1u << 30);
  RunningQuery::Traits traits{query.reduce,
                              query.format,
                              received,
                              begun + kPairCost * pairs,
                              Clock::now() - begun,
                              std::move(records),
                              parts.options.max_reply_bytes};
  scheduler_.add(std::make_unique<RunningQuery>(answers_, std::move(sink), header, std::move(share), engine_,
                                                std::move(job), std::move(room), std::move(traits)));
}

std::vector<std::byte> Loop::pair_table(const FrameHeader& header, std::span<const std::byte> payload) {
  const std::vector<std::byte> copy(payload.begin(), payload.end());  // aligned
  const wire::QueryParts parts = wire::parse_query(header, copy);
  check_epoch(FrameType::kPairs, parts.epoch);
  stats_.records_ignored += parts.passed_over.size();
  const std::vector<BodyPair> pairs = engine_->pairs(view_of(parts, header.scene_revision));
  wire::PairsHeader table;
  table.scene_revision = header.scene_revision ? header.scene_revision : engine_->scene_revision();
  table.count = pairs.size();
  std::vector<std::byte> reply(sizeof table + pairs.size() * sizeof(BodyPair));
  std::memcpy(reply.data(), &table, sizeof table);
  if (!pairs.empty()) std::memcpy(reply.data() + sizeof table, pairs.data(), pairs.size() * sizeof(BodyPair));
  return reply;
}

wire::PosesResult Loop::set_poses(const FrameHeader& header, std::span<const std::byte> payload, std::uint64_t client) {
  const wire::PosesParts parts = wire::parse_poses(payload);
  poses_.resize(parts.poses.size());
  ids_.resize(parts.poses.size());
  for (std::uint64_t i = 0; i < parts.poses.size(); ++i) {
    const wire::PoseRecord record = parts.poses[i];
    poses_[i] = {record.body, pose_of(record.pose)};
    ids_[i] = record.body;
  }
  check_scene(*engine_, header, ids_, true);
  return result_of(on_poses(poses_, parts.header.stamp_ns, parts.header.sequence, client), engine_->scene_revision());
}

PoseUpdateResult Loop::on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                                std::uint64_t publisher) {
  const PoseUpdateResult done = engine_->set_poses(poses, stamp_ns, sequence, publisher);
  ++stats_["poses.batches"];
  stats_["poses.applied"] += done.applied;
  stats_["poses.bad"] += done.bad;
  stats_["poses.unknown"] += done.unknown;
  stats_["poses.fixed"] += done.fixed;
  poses_changed_ = true;
  return done;
}

wire::PosesResult Loop::attach(const FrameHeader& header, std::span<const std::byte> payload) {
  const wire::AttachRecord record = wire::parse_attach(payload);
  check_scene(*engine_, header, std::array{record.child}, true);
  if (record.parent != kNone) check_scene(*engine_, header, std::array{record.parent});
  const Pose X_pc = pose_of(record.pose);
  const bool is_behind = header.scene_revision && header.scene_revision != engine_->scene_revision();
  const auto done = engine_->attach(record.child, record.parent, record.has_pose ? &X_pc : nullptr);
  ++stats_["attachments"];
  poses_changed_ = true;
  // Who knew the scene before this knows the one after it; who was behind goes on with the ids that it knows.
  return result_of(done, is_behind ? header.scene_revision : engine_->scene_revision());
}

Stats::Named Loop::all_counters() const {
  const std::uint64_t waiting = scheduler_.size(), held = held_.size();
  Stats::Named all;
  all.emplace_back("uptime_s", std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - started_).count());
  all.emplace_back("queries.waiting", waiting);
  all.emplace_back("queries.held", held);
  all.emplace_back("requests.waiting", waiting + held + scenes_.waiting());
  stats_.append_to(all);
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

}  // namespace clearance
