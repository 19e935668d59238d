#include "server/core/request_router.h"

#include <algorithm>
#include <string>
#include <utility>

#include "engine/narrow/work_meter.h"
#include "server/core/scene_frame.h"
#include "server/requests/request_payload.h"
#include "server/tasks/certificate_request.h"
#include "server/tasks/pair_listing.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

/// @tparam Work PairListing or CertificateRequest, which work in slices
/// @param reply_bytes that the reply takes of the quota
template <class Work>
void work_in_background(RequestRouter& router, Request& request, std::uint64_t reply_bytes) {
  RequestContext& context = router.context;
  const auto work = std::make_shared<Work>(context.answers, context.engine, request.header, request.take_payload());
  context.reply_in_background(request, request.bytes + reply_bytes,
                              [work](auto budget, std::uint64_t& ignored) { return work->advance(budget, ignored); });
}

void certify(RequestRouter& on, Request& request) {
  work_in_background<CertificateRequest>(on, request, CertificateRequest::kMostBytes);
}

/// Returns a request's row of the table, or null for an unknown type. A row has the client's right, the thread that
/// answers, how a small payload is read, the type of the reply, and the handler.
const RequestType* find_type(std::uint16_t type) {
  using enum RunsOn;
  using enum Payload;
  using enum FrameType;
  constexpr auto list_pairs = [](auto& on, auto& r) { work_in_background<PairListing>(on, r, 0); };
  constexpr auto send_scene = [](auto& on, auto& r) { on.send(r, on.bodies(), scene_payload); };
  constexpr auto send_states = [](auto& on, auto& r) { on.send(r, on.bodies(), states_payload); };
  constexpr auto send_joints = [](auto& on, auto& r) { on.send(r, on.joints(), joints_payload); };
  // clang-format off
  static constexpr RequestType kRequests[] = {
    // request      right      runs on       payload  reply
    {kPing,       0,         kLoopIfSmall, kBody,  kPong,         [](auto& on, auto& r) { on.ping(r); }},
    {kDescribe,   kMayQuery, kLoopIfSmall, kEmpty, kScene,        send_scene},
    {kGetStates,  kMayQuery, kLoopIfSmall, kEmpty, kBodyStates,   send_states},
    {kGetJoints,  kMayQuery, kLoopIfSmall, kEmpty, kJoints,       send_joints},
    {kGetStats,   kMayQuery, kLoop,        kEmpty, kStats,        [](auto& on, auto& r) { on.send_stats(r); }},
    {kQuery,      kMayQuery, kLoopIfSmall, kWhole, kReply,        [](auto& on, auto& r) { on.queries.start(r); }},
    {kPairs,      kMayQuery, kWorker,      kWhole, kPairTable,    list_pairs},
    {kCertify,    kMayQuery, kWorker,      kWhole, kCertificate,  certify},
    {kOpenPlan,   kMayQuery, kPlanWorker,  kWhole, kPlan,         [](auto& on, auto& r) { on.plans.open(r); }},
    {kRunPlan,    kMayQuery, kRunWorker,   kBody,  kPlanDone,     [](auto& on, auto& r) { on.plans.run(r); }},
    {kClosePlan,  kMayQuery, kLoop,        kBody,  kPlanDone,     [](auto& on, auto& r) { on.plans.close(r); }},
    {kSetPoses,   kMayPose,  kLoopIfSmall, kWhole, kPosesDone,    [](auto& on, auto& r) { on.updates.set_poses(r); }},
    {kSetJoints,  kMayPose,  kLoopIfSmall, kWhole, kPosesDone,    [](auto& on, auto& r) { on.updates.set_poses(r); }},
    {kSetPoints,  kMayPose,  kPointWorker, kWhole, kPosesDone,    [](auto& on, auto& r) { on.updates.set_points(r); }},
    {kAttach,     kMayPose,  kLoop,        kWhole, kPosesDone,    [](auto& on, auto& r) { on.updates.attach(r); }},
    {kAllow,      kMayPose,  kLoop,        kBody,  kPosesDone,    [](auto& on, auto& r) { on.updates.allow(r); }},
    {kAddBody,    kMayPose,  kSceneThread, kWhole, kSceneChanged, [](auto& on, auto& r) { on.scenes.add_body(r); }},
    {kRemoveBody, kMayPose,  kSceneThread, kBody,  kSceneChanged, [](auto& on, auto& r) { on.scenes.remove_body(r); }},
    {kReload,     kMayAdmin, kSceneThread, kEmpty, kSceneChanged, [](auto& on, auto& r) { on.scenes.request_reload(r); }},
  };
  // clang-format on
  const auto found = std::find_if(std::begin(kRequests), std::end(kRequests), [type](const RequestType& row) {
    return static_cast<std::uint16_t>(row.type) == type;
  });
  return found == std::end(kRequests) ? nullptr : &*found;
}

/// Largest payload of a request whose large payloads are not read on a worker (kAddBody).
constexpr std::uint64_t kMostOnLoop = 1 << 20;

/// Returns whether a handler takes large payloads, which a worker reads.
bool takes_large(const RequestType* type) {
  return type && type->payload != Payload::kEmpty &&
         (type->runs_on == RunsOn::kLoopIfSmall || type->runs_on == RunsOn::kWorker ||
          type->runs_on == RunsOn::kPointWorker || type->runs_on == RunsOn::kPlanWorker);
}

void check_right(Rights needed, const Request& request) {
  if (const Rights rights = request.sink->rights(); needed & ~rights)
    throw RejectedRequest{ErrorCode::kForbidden, wire::type_name(request.header.type) + " needs the right \"" +
                                                     rights_text(needed) + "\"; this client has " +
                                                     rights_text(rights)};
}

}  // namespace

Rights right_for(FrameType request) {
  const RequestType* type = find_type(static_cast<std::uint16_t>(request));
  return type ? type->right : Rights{0};
}

RequestRouter::RequestRouter(std::shared_ptr<engine::Engine> engine, Workers& workers, const Limits& limits,
                             std::chrono::nanoseconds slice)
    : context(std::move(engine), workers, limits, limits.require_epoch),
      queries(context, limits, slice),
      updates(context, limits),
      plans(context, limits, limits),
      scenes(context.engine, context.answers, context.stats, context.quotas, limits) {}

void RequestRouter::route(Request request) {
  ++context.stats.frames;
  ReplySink& sink = *request.sink;  // lives on with the request if that is answered later
  context.answers.guard(sink, request.header, [&] { dispatch(request); });
}

void RequestRouter::dispatch(Request& request) {
  const FrameHeader& header = request.header;
  wire::check_header(header, request.bytes);
  const RequestType* type = request.type = find_type(header.type);
  check_right(type ? type->right : Rights{0}, request);
  OwnPayload own;
  if (request.is_large() && !takes_large(type)) {
    if (request.bytes > kMostOnLoop)
      throw RejectedRequest{ErrorCode::kBadFrame, wire::type_name(header.type) + ": a payload of " +
                                                      std::to_string(request.bytes) + " bytes, more than the " +
                                                      std::to_string(kMostOnLoop) + " that a request of this type has"};
    own = std::exchange(request.fetch, nullptr)();
    request.payload = own.span();
  }
  if (!request.is_large() && !(type && type->payload == Payload::kWhole))
    request.payload = without_records(context.answers, header, request.payload, context.stats.records_ignored);
  if (!type)
    throw RejectedRequest{ErrorCode::kUnknownType, "frame: type " + wire::type_name(header.type) + " is no request"};
  if (type->payload == Payload::kEmpty) wire::parse_empty(request.payload, header.type);
  type->handle(*this, request);
}

void RequestRouter::ping(Request& request) {
  if (!request.is_large()) return context.reply(request, request.payload);
  const auto make = [&answers = context.answers, header = request.header, fetch = request.take_payload()](
                        auto, std::uint64_t& ignored) {
    const OwnPayload payload = fetch();
    const auto body = without_records(answers, header, payload.span(), ignored);
    count_copied(body.size());
    return std::vector<std::byte>(body.begin(), body.end());
  };
  context.reply_in_background(request, request.bytes, make);
}

void RequestRouter::send(Request& request, std::size_t size, std::vector<std::byte> (*payload)(const engine::Engine&)) {
  if (size <= kFewBodies) return context.reply(request, payload(*context.engine));
  context.reply_in_background(request, 0, [engine = context.engine, payload](auto, auto&) { return payload(*engine); });
}

void RequestRouter::send_stats(Request& request) {
  std::vector<std::byte> payload;
  for (const auto& [name, value] : counters()) {
    wire::CounterRecord record;
    wire::set_name(record.name, name);
    record.value = value + (name == "requests.waiting");  // includes this request
    wire::append(payload, record);
  }
  context.reply(request, payload);
}

Stats::Named RequestRouter::counters() {
  const auto uptime = std::chrono::steady_clock::now() - started_;
  const std::uint64_t running = waiting(), deferred = queries.deferred().size();
  Stats::Named all{{"uptime_s", std::chrono::duration_cast<std::chrono::seconds>(uptime).count()},
                   {"queries.waiting", running},
                   {"queries.held", deferred},
                   {"requests.waiting", running + deferred + scenes.waiting()},
                   {"plans.open", plans.count()},
                   {"plans.bytes", plans.bytes()}};
  heaps_.append_to(all);
  context.stats.append_to(all);
  const auto engine = context.engine->stats();
  all.insert(all.end(), engine.begin(), engine.end());
  return all;
}

void RequestRouter::drop_gone() {
  context.workers.check_clients();
  plans.drop_gone();
  queries.drop_gone();
  context.stats.dropped += scenes.drop_gone();
}

}  // namespace clearance
