// The loop's answers to requests: each is checked, then answered at once or handed to whoever answers it later.
#include <algorithm>
#include <cstring>
#include <utility>

#include "server/core/loop.h"
#include "server/core/scene_frame.h"
#include "server/requests/request_payload.h"
#include "server/tasks/certificate_request.h"
#include "server/tasks/pair_listing.h"
#include "server/tasks/query_task.h"
#include "wire/aligned_buffer.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

/// What a pair is taken to cost, to tell when a query is due. A guess is enough: it only orders one client's queries.
constexpr auto kPairCost = std::chrono::microseconds(1);

/// What a query may name so that the loop itself begins it: it is then answered by one thread, and what it takes
/// beyond a slice, by the worker.
constexpr std::uint64_t kSmallPairs = 256, kSmallPiecePairs = 8192, kSmallLists = 8192, kSmallLinks = 4096;
/// Scenes of more bodies are described by the worker.
constexpr std::size_t kFewBodies = 1000;
/// The largest requests of other types (kAddBody) are read here.
constexpr std::uint64_t kMostOfOthers = 1 << 20;

Loop::Clock::time_point due(Loop::Clock::time_point begun, std::uint64_t pairs) {
  return begun + kPairCost * std::min<std::uint64_t>(pairs, 1u << 30);
}

/// A payload that is good after the call, too.
std::function<OwnPayload()> own_copy(std::span<const std::byte> payload) {
  const std::shared_ptr<std::byte> copy(aligned_bytes(payload.size()).release(), FreeDeleter());
  if (!payload.empty()) std::memcpy(copy.get(), payload.data(), payload.size());
  count_copied(payload.size());
  return [own = OwnPayload{copy, payload.size()}] { return own; };
}

}  // namespace

void Loop::on_frame(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink> sink) {
  ++stats_.frames;
  ReplySink& way_back = *sink;  // lives on with the request if that is answered later
  answers_.guard(way_back, header, [&] { handle(header, payload, sink); });
}

void Loop::check_right(const FrameHeader& header, const ReplySink& sink) {
  if (const Rights needed = right_for(static_cast<FrameType>(header.type)); needed & ~sink.rights())
    throw RejectedRequest{ErrorCode::kForbidden, wire::type_name(header.type) + " needs the right \"" +
                                                     rights_text(needed) + "\"; this client has " +
                                                     rights_text(sink.rights())};
}

void Loop::handle(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink) {
  wire::check_header(header, payload.size());
  const auto type = static_cast<FrameType>(header.type);
  check_right(header, *sink);
  const bool is_update = type == FrameType::kSetPoses || type == FrameType::kSetJoints;
  // Behind what the client sent before, or where each of many bodies may move.
  const bool waits = is_update && (poses_away_.contains(sink->client()) ||
                                   (type == FrameType::kSetJoints && engine_->scene().bodies().size() > kFewBodies));
  if (type != FrameType::kQuery && type != FrameType::kPairs && type != FrameType::kCertify &&
      type != FrameType::kOpenPlan && type != FrameType::kAttach && type != FrameType::kAddBody &&
      type != FrameType::kSetPoints && !waits)
    payload = without_records(answers_, header, payload, stats_.records_ignored);
  const auto reply = [&](FrameType with, std::span<const std::byte> bytes) {
    answers_.reply(*sink, header, with, bytes);
  };
  const auto is_empty = [&] { wire::parse_empty(payload, header.type); };
  const bool few = engine_->scene().bodies().size() <= kFewBodies;
  switch (type) {
    case FrameType::kPing:
      return reply(FrameType::kPong, payload);
    case FrameType::kDescribe:
      is_empty();
      if (few) return reply(FrameType::kScene, scene_payload(*engine_));
      return reply_elsewhere(header, 0, FrameType::kScene, [e = engine_](auto) { return scene_payload(*e); }, sink);
    case FrameType::kQuery:
      return start_query(header, payload, sink);
    case FrameType::kPairs:
      return list_pairs(header, own_copy(payload), payload.size(), sink);
    case FrameType::kCertify:
      return certify(header, own_copy(payload), payload.size(), sink);
    case FrameType::kOpenPlan:
      return open_plan(header, own_copy(payload), payload.size(), sink);
    case FrameType::kRunPlan:
      return run_plan(header, payload, sink);
    case FrameType::kClosePlan:
      return reply(FrameType::kPlanDone, bytes_of(close_plan(payload, sink->client())));
    case FrameType::kGetJoints:
      is_empty();
      if (engine_->scene().joints().size() <= kFewBodies) return reply(FrameType::kJoints, joints_payload(*engine_));
      return reply_elsewhere(header, 0, FrameType::kJoints, [e = engine_](auto) { return joints_payload(*e); }, sink);
    case FrameType::kSetPoints:
      return set_points_elsewhere(header, own_copy(payload), payload.size(), sink);
    case FrameType::kSetPoses:
    case FrameType::kSetJoints:
      if (waits) return set_poses_elsewhere(header, own_copy(payload), payload.size(), sink);
      return reply(FrameType::kPosesDone, bytes_of(set_poses(header, payload, sink->client())));
    case FrameType::kAttach:
      return reply(FrameType::kPosesDone, bytes_of(attach(header, payload)));
    case FrameType::kAllow:
      return reply(FrameType::kPosesDone, bytes_of(allow(header, payload)));
    case FrameType::kGetStates:
      is_empty();
      if (few) return reply(FrameType::kBodyStates, states_payload(*engine_));
      return reply_elsewhere(
          header, 0, FrameType::kBodyStates, [e = engine_](auto) { return states_payload(*e); }, sink);
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
  throw RejectedRequest{ErrorCode::kUnknownType, "frame: type " + wire::type_name(header.type) + " is no request"};
}

void Loop::start_query(const FrameHeader& header, std::span<const std::byte> payload,
                       std::unique_ptr<ReplySink>& sink) {
  ++stats_.queries;
  quotas_.check_requests(sink->client());
  payload = aligned(payload, aligned_);
  const wire::QueryParts parts = wire::parse_query(header, payload);
  answers_.check_epoch(header, parts.epoch);
  const QueryOptions& asked = parts.options;
  stats_.records_ignored += parts.passed_over.size();
  if (asked.min_pose_stamp_ns == 0 || DeferredQueries::poses_are_there(*engine_, header, asked))
    return begin_query(header, parts, payload, sink, turn_began_);
  const QueryView query = view_of(parts, header.scene_revision);
  if (is_small(engine_->extent(query))) engine_->size(query);  // what is wrong with it is said at once
  hold(header, class_for(*sink, asked), asked, own_copy(payload)(), sink, turn_began_);
}

/// Holds a query until its poses are there; false: they are.
bool Loop::hold(const FrameHeader& header, ServiceClass service, const QueryOptions& asked, const OwnPayload& payload,
                std::unique_ptr<ReplySink>& sink, Clock::time_point received) {
  if (DeferredQueries::poses_are_there(*engine_, header, asked)) return false;
  held_.hold(header, service, asked, payload, sink, quotas_, *engine_, received);
  ++stats_["queries.held_back"];
  return true;
}

void Loop::begin_held(DeferredQuery held) {
  std::unique_ptr<ReplySink> sink = std::move(held.asked.sink);
  ReplySink& way_back = *sink;  // lives on with the query
  const FrameHeader& header = held.asked.header;
  held.asked.share.give_back();
  answers_.guard(way_back, header, [&] {
    if (!DeferredQueries::poses_are_there(*engine_, header, held.query)) throw poses_late(held.query, true);
    const auto fetch = [payload = held.payload] { return payload; };
    if (held.payload.bytes > kLargePayload)
      return begin_elsewhere(new_query(header, *sink, held.service, held.received, held.received), fetch,
                             held.payload.bytes, {}, sink);
    const auto payload = aligned(held.payload.span(), aligned_);
    begin_query(header, wire::parse_query(header, payload), payload, sink, held.received);
  });
}

bool Loop::is_small(const QueryCost& extent) const {
  return extent.pairs < kSmallPairs && extent.piece_pairs <= kSmallPiecePairs && extent.listed <= kSmallLists &&
         extent.links <= kSmallLinks && engine_->has_cpu();
}

/// Begins a query here if it is small, else has it begun by the worker. Its poses are there.
void Loop::begin_query(const FrameHeader& header, const wire::QueryParts& parts, std::span<const std::byte> payload,
                       std::unique_ptr<ReplySink>& sink, Clock::time_point received) {
  const QueryCost extent = engine_->extent(view_of(parts, header.scene_revision));
  // What each pair leaves to the joints is looked at beforehand, beside the loop.
  const bool is_here =
      is_small(extent) && !poses_away_.contains(sink->client()) && !(parts.options.fields & kFieldFreeScale);
  // Of those elsewhere no two are due at once: one ends, then the next.
  auto query = new_query(header, *sink, class_for(*sink, parts.options), received,
                         due(is_here ? received : Clock::now(), extent.pairs));
  query->take_options(parts.options, extent);
  if (!is_here) return begin_elsewhere(std::move(query), own_copy(payload), payload.size(), extent, sink);
  query->begin_here(parts, payload.size(), sink);
  small_.add(std::move(query));
}

std::unique_ptr<QueryTask> Loop::new_query(const FrameHeader& header, const ReplySink& sink, ServiceClass service,
                                           Clock::time_point received, Clock::time_point due) {
  return std::make_unique<QueryTask>(daemon_, sink.client(), service, header, engine_, received, due);
}

/// A query may ask for less than its client has. Behind its client's poses it goes where they went.
ServiceClass Loop::class_for(const ReplySink& sink, const QueryOptions& asked) const {
  if (const auto away = poses_away_.find(sink.client()); away != poses_away_.end()) return away->second.service;
  return asked.as_planning ? ServiceClass::kPlanning : sink.service_class();
}

void Loop::begin_elsewhere(std::unique_ptr<QueryTask> query, std::function<OwnPayload()> fetch,
                           std::uint64_t payload_bytes, const QueryCost& extent, std::unique_ptr<ReplySink>& sink) {
  query->begin_elsewhere(std::move(fetch), payload_bytes, extent.listed, sink);
  worker_of(query->service_class()).add(std::move(query));
}

/// Has the worker make a reply's payload. \param bytes of the request
void Loop::reply_elsewhere(const FrameHeader& header, std::uint64_t bytes, FrameType type, BackgroundRequest::Make make,
                           std::unique_ptr<ReplySink>& sink, BackgroundRequest::Done done) {
  const ServiceClass service = class_for(*sink, kDefaultOptions);
  quotas_.check_requests(sink->client());
  quotas_.check_bytes(sink->client(), service, bytes, sink->unsent_bytes());
  PendingRequest asked{nullptr, header, quotas_.take(sink->client(), service, bytes)};
  asked.sink = std::move(sink);
  worker_of(service).add(std::make_unique<BackgroundRequest>(answers_, std::move(asked), service, type, turn_began_,
                                                             std::move(make), std::move(done)));
}

void Loop::echo_elsewhere(const FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                          std::unique_ptr<ReplySink>& sink) {
  const auto ignored = std::make_shared<std::uint64_t>(0);
  const auto make = [this, header, ignored, fetch = std::move(fetch)](auto) {
    const OwnPayload payload = fetch();
    const auto body = without_records(answers_, header, payload.span(), *ignored);
    count_copied(body.size());
    return std::vector<std::byte>(body.begin(), body.end());
  };
  reply_elsewhere(header, bytes, FrameType::kPong, make, sink, count_later(ignored));
}

void Loop::list_pairs(const FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                      std::unique_ptr<ReplySink>& sink) {
  const auto ignored = std::make_shared<std::uint64_t>(0);
  const auto listing = std::make_shared<PairListing>(answers_, engine_, header, std::move(fetch));
  const auto make = [listing, ignored](std::chrono::nanoseconds budget) { return listing->advance(budget, *ignored); };
  reply_elsewhere(header, bytes, FrameType::kPairTable, make, sink, count_later(ignored));
}

/// It counts, whatever becomes of it, as what its document may take.
void Loop::certify(const FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                   std::unique_ptr<ReplySink>& sink) {
  const auto ignored = std::make_shared<std::uint64_t>(0);
  const auto asked = std::make_shared<CertificateRequest>(answers_, engine_, header, std::move(fetch));
  const auto make = [asked, ignored](std::chrono::nanoseconds budget) { return asked->advance(budget, *ignored); };
  reply_elsewhere(header, bytes + CertificateRequest::kMostBytes, FrameType::kCertificate, make, sink,
                  count_later(ignored));
}

/// Counts records that whoever works has ignored, on the loop.
BackgroundRequest::Done Loop::count_later(std::shared_ptr<const std::uint64_t> ignored) {
  return [this, ignored](bool) {
    stats_.records_ignored += *ignored;
    return true;
  };
}

void Loop::on_large_frame(const FrameHeader& header, std::uint64_t payload_bytes, std::function<OwnPayload()> fetch,
                          std::unique_ptr<ReplySink> sink) {
  ++stats_.frames;
  ReplySink& way_back = *sink;  // lives on with the request if that is answered later
  answers_.guard(way_back, header, [&] {
    wire::check_header(header, payload_bytes);
    check_right(header, *sink);
    switch (static_cast<FrameType>(header.type)) {
      case FrameType::kQuery:
        ++stats_.queries;
        quotas_.check_requests(sink->client());
        return begin_elsewhere(new_query(header, *sink, class_for(*sink, kDefaultOptions), turn_began_,
                                         due(Clock::now(), payload_bytes / sizeof(BodyPair))),
                               std::move(fetch), payload_bytes, {}, sink);
      case FrameType::kPairs:
        return list_pairs(header, std::move(fetch), payload_bytes, sink);
      case FrameType::kCertify:
        return certify(header, std::move(fetch), payload_bytes, sink);
      case FrameType::kOpenPlan:
        return open_plan(header, std::move(fetch), payload_bytes, sink);
      case FrameType::kSetPoses:
      case FrameType::kSetJoints:
        return set_poses_elsewhere(header, std::move(fetch), payload_bytes, sink);
      case FrameType::kSetPoints:
        return set_points_elsewhere(header, std::move(fetch), payload_bytes, sink);
      case FrameType::kPing:
        return echo_elsewhere(header, std::move(fetch), payload_bytes, sink);
      default:
        break;
    }
    if (payload_bytes > kMostOfOthers)
      throw RejectedRequest{ErrorCode::kBadFrame, wire::type_name(header.type) + ": a payload of " +
                                                      std::to_string(payload_bytes) + " bytes, more than the " +
                                                      std::to_string(kMostOfOthers) +
                                                      " that a request of this type has"};
    const OwnPayload payload = fetch();
    handle(header, payload.span(), sink);
  });
}

Stats::Named Loop::all_counters() const {
  const std::uint64_t waiting = this->waiting(), held = held_.size();
  Stats::Named all;
  all.emplace_back("uptime_s", std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - started_).count());
  all.emplace_back("queries.waiting", waiting);
  all.emplace_back("queries.held", held);
  all.emplace_back("requests.waiting", waiting + held + scenes_.waiting());
  all.emplace_back("plans.open", plans_.count());
  all.emplace_back("plans.bytes", plans_.bytes());
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
