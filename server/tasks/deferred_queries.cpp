#include "server/tasks/deferred_queries.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <unordered_map>

#include "server/requests/scene_check.h"

namespace clearance {
namespace {

/// Stamps that poses have reached, each computed once.
class Reached {
 public:
  explicit Reached(const engine::Engine& engine) : engine_(engine) {}
  std::int64_t stamp(std::uint32_t bodies) {
    const auto [known, is_new] = known_.try_emplace(bodies, 0);
    if (is_new) known->second = engine_.oldest_stamp(bodies);
    return known->second;
  }

 private:
  const engine::Engine& engine_;
  std::unordered_map<std::uint32_t, std::int64_t> known_;
};

bool is_reached(Reached& reached, const engine::Engine& engine, const wire::FrameHeader& request,
                const QueryOptions& query) {
  if (query.wait_for != kEveryBody) check_scene(engine, request, std::array{query.wait_for});
  const std::int64_t stamp = reached.stamp(query.wait_for);
  return stamp != 0 && stamp >= query.min_pose_stamp_ns;
}

/// Longest wait of a query, in ns.
std::int64_t wait_of(const QueryOptions& query) {
  return query.deadline_ns ? std::min(query.deadline_ns, kLongestPoseWait) : kLongestPoseWait;
}

/// Whether a query's wait is over.
bool is_over(const DeferredQuery& held, const engine::Engine& engine, Reached& reached,
             DeferredQueries::Clock::time_point now) {
  if (now >= held.deadline) return true;
  try {
    return is_reached(reached, engine, held.pending.header, held.query);
  } catch (const engine::QueryError&) {  // another scene: reported when the query begins
    return true;
  } catch (const RejectedRequest&) {  // likewise
    return true;
  }
}

}  // namespace

RejectedRequest poses_late(const QueryOptions& query) {
  const double ms = 1e-6 * static_cast<double>(wait_of(query));
  return {wire::ErrorCode::kPosesLate, "no poses with stamp " + std::to_string(query.min_pose_stamp_ns) +
                                           " or newer came within " + std::to_string(ms) + " ms"};
}

bool DeferredQueries::poses_are_there(const engine::Engine& engine, const wire::FrameHeader& request,
                                      const QueryOptions& query) {
  Reached reached(engine);
  return is_reached(reached, engine, request, query);
}

void DeferredQueries::hold(const wire::FrameHeader& request, ServiceClass service, const QueryOptions& query,
                           OwnPayload payload, std::unique_ptr<ReplySink>& sink, Quotas& quotas,
                           const engine::Engine& engine, Clock::time_point received) {
  const std::uint64_t client = sink->client();
  quotas.check_bytes(client, service, payload.bytes, sink->unsent_bytes());
  DeferredQuery held{{nullptr, request, quotas.take(client, service, payload.bytes)},
                     service,
                     query,
                     std::move(payload),
                     received,
                     received + std::chrono::nanoseconds(wait_of(query))};
  if (held_.empty()) looked_at_revision_ = engine.pose_revision();  // the others are checked at the next revision
  deadline_ = std::min(deadline_, held.deadline);
  held_.push_back(std::move(held));
  held_.back().pending.sink = std::move(sink);  // last, as the caller needs it after an exception
}

/// Moves those whose wait is over to over_.
void DeferredQueries::part(const engine::Engine& engine, Clock::time_point now) {
  const std::uint64_t revision = engine.pose_revision();
  if (revision == looked_at_revision_ && now < deadline_) return;
  looked_at_revision_ = revision;
  Reached reached(engine);
  const auto first = std::stable_partition(
      held_.begin(), held_.end(), [&](const DeferredQuery& held) { return !is_over(held, engine, reached, now); });
  over_.insert(over_.end(), std::make_move_iterator(first), std::make_move_iterator(held_.end()));
  held_.erase(first, held_.end());
  deadline_ = Clock::time_point::max();
  for (const DeferredQuery& held : held_) deadline_ = std::min(deadline_, held.deadline);
}

std::size_t DeferredQueries::drop_gone() {
  const auto is_gone = [](const DeferredQuery& held) { return !held.pending.sink->alive(); };
  const auto dropped = std::erase_if(held_, is_gone) + std::erase_if(over_, is_gone);
  if (held_.empty()) deadline_ = Clock::time_point::max();
  return dropped;
}

}  // namespace clearance
