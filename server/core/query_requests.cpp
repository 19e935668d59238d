#include "server/core/query_requests.h"

#include <algorithm>
#include <utility>

namespace clearance {
namespace {

using wire::FrameHeader;

/// Rough cost of a pair, for the order of one client's queries.
constexpr auto kPairCost = std::chrono::microseconds(1);

/// Size of a query that the loop itself begins, on one thread.
constexpr std::uint64_t kSmallPairs = 256, kSmallPartPairs = 8192, kSmallLists = 8192, kSmallLinks = 4096;

/// Most motions need fewer evaluations, which the loop makes in its slice.
constexpr std::uint32_t kMotionEvaluations = 16;
/// Pairs times moved links of a motion, whose bounds are made before its slice.
constexpr std::uint64_t kSmallPairLinks = 8192;

/// Part pairs of a query with rows of second order, each of which is one step: it evaluates at most 256 part pairs.
constexpr std::uint64_t kSmallRowParts = 1024;

/// Queries with steps that do not end with the slice: the free scale tests for each pair beforehand which joints move
/// it, and the smooth radius compares all part pairs of a row.
bool is_for_workers(const QueryOptions& options, const QueryCost& cost) {
  if (options.fields & (kFieldFreeScale | kFieldSmoothRadius)) return true;
  return (options.fields & (kSecondOrderFields & ~kFieldRate)) && cost.part_pairs > kSmallRowParts;
}

QueryRequests::Clock::time_point due(QueryRequests::Clock::time_point begun, std::uint64_t pairs) {
  return begun + kPairCost * std::min<std::uint64_t>(pairs, 1u << 30);
}

}  // namespace

QueryRequests::QueryRequests(RequestContext& context, const QueryLimits& limits, std::chrono::nanoseconds slice)
    : context_(context),
      small_(slice),
      daemon_{context.answers,
              context.quotas,
              context.stats,
              limits,
              forecast_,
              [&context](std::shared_ptr<void> thing) { context.workers.drop(std::move(thing)); },
              [this](const FrameHeader& header, ServiceClass service, const QueryOptions& options,
                     const OwnPayload& payload, std::unique_ptr<ReplySink>& sink,
                     Clock::time_point received) { return defer(header, service, options, payload, sink, received); }} {
}

void QueryRequests::start(Request& request) {
  ++context_.stats.queries;
  context_.quotas.check_requests(request.sink->client());
  if (request.is_large())
    return begin_on_worker(new_query(request, context_.class_for(*request.sink, request.header),
                                     due(Clock::now(), request.bytes / sizeof(BodyPair))),
                           request, {});
  request.payload = aligned(request.payload, aligned_);
  const FrameHeader& header = request.header;
  engine::Engine& engine = *context_.engine;
  const ClientQuery& query = clients_.read(*request.sink, header, request.payload, engine);
  context_.answers.check_epoch(header, query.parts.epoch);
  context_.stats.records_ignored += query.parts.passed_over.size();
  const QueryOptions& options = query.parts.options;
  if (options.min_pose_stamp_ns == 0 || DeferredQueries::poses_are_there(engine, header, options))
    return begin(request, query);
  // Throws for a bad query before it waits.
  if (is_small(query.cost, options)) engine.size(view_of(query.parts, header.scene_revision));
  defer(header, context_.class_for(*request.sink, header), options, request.take_payload()(), request.sink,
        request.received);
}

/// Begins a query whose poses have arrived.
void QueryRequests::begin(Request& request, const ClientQuery& query) {
  const auto& [parts, cost, jobs] = query;
  const bool is_here = is_small(cost, parts.options) && !context_.has_pose_updates(request.sink->client()) &&
                       !is_for_workers(parts.options, cost);
  // Counted from now for queries on a worker, so that one ends before the next one of the client.
  auto task = new_query(request, context_.class_for(*request.sink, request.header),
                        due(is_here ? request.received : Clock::now(), cost.pairs));
  task->take_options(parts.options, cost);
  if (!is_here) return begin_on_worker(std::move(task), request, cost);
  task->begin_on_loop(parts, request.bytes, request.sink, jobs);
  small_.add(std::move(task));
}

void QueryRequests::begin_on_worker(std::unique_ptr<QueryTask> query, Request& request, const QueryCost& cost) {
  query->begin_on_worker(request.take_payload(), request.bytes, cost.listed, request.sink);
  context_.workers.of(query->service_class()).add(std::move(query));
}

std::unique_ptr<QueryTask> QueryRequests::new_query(const Request& request, ServiceClass service,
                                                    Clock::time_point due) const {
  return std::make_unique<QueryTask>(daemon_, request.sink->client(), service, request.header, context_.engine,
                                     request.received, due);
}

/// A motion counts as one evaluation of its pairs: its slice on the loop may end before the others. Placing the links
/// of an evaluation is not divided.
bool QueryRequests::is_small(const QueryCost& cost, const QueryOptions& options) const {
  const std::uint64_t evaluations = std::max(options.max_evaluations, 1u),
                      few = std::min<std::uint64_t>(evaluations, kMotionEvaluations);
  const std::uint64_t pairs = cost.pairs / evaluations, links = cost.links / evaluations;
  return pairs < kSmallPairs && cost.part_pairs / evaluations <= kSmallPartPairs && cost.listed <= kSmallLists &&
         links <= kSmallLinks / few && (options.max_evaluations == 0 || pairs * links <= kSmallPairLinks) &&
         context_.engine->has_cpu();
}

bool QueryRequests::work() {
  if (small_.empty()) return false;
  small_.work(Clock::now(), [this](Worker::QueryPtr query) { context_.workers.advance_on_loop(std::move(query)); });
  return true;
}

/// Defers a query until its poses have arrived. Returns false if they have.
bool QueryRequests::defer(const FrameHeader& header, ServiceClass service, const QueryOptions& options,
                          const OwnPayload& payload, std::unique_ptr<ReplySink>& sink, Clock::time_point received) {
  if (DeferredQueries::poses_are_there(*context_.engine, header, options)) return false;
  deferred_.hold(header, service, options, payload, sink, context_.quotas, *context_.engine, received);
  ++context_.stats["queries.held_back"];
  return true;
}

bool QueryRequests::begin_deferred(Clock::time_point now) {
  return !deferred_.empty() && deferred_.release(*context_.engine, now,
                                                 [this](DeferredQuery query) { begin_one_deferred(std::move(query)); });
}

void QueryRequests::begin_one_deferred(DeferredQuery deferred) {
  const FrameHeader& header = deferred.pending.header;
  const OwnPayload& payload = deferred.payload;
  Request request{header, payload.span(), nullptr, payload.bytes, std::move(deferred.pending.sink), deferred.received};
  ReplySink& sink = *request.sink;  // lives on with the query
  deferred.pending.share.give_back();
  context_.answers.guard(sink, header, [&] {
    if (!DeferredQueries::poses_are_there(*context_.engine, header, deferred.query)) throw poses_late(deferred.query);
    if (payload.bytes > kLargePayload) {
      request.fetch = [payload] { return payload; };
      return begin_on_worker(new_query(request, deferred.service, deferred.received), request, {});
    }
    request.payload = aligned(request.payload, aligned_);
    begin(request, clients_.read(*request.sink, header, request.payload, *context_.engine));
  });
}

void QueryRequests::drop_gone() {
  clients_.drop_gone();
  const std::size_t dropped = deferred_.drop_gone();
  if (dropped == 0) return;  // a counter exists from its first use
  context_.stats.dropped += dropped;
  context_.stats["queries.dropped"] += dropped;
}

}  // namespace clearance
