#include "held_queries.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "scene_check.h"

namespace clearance {
namespace {

/// Whether a query need not wait any longer.
bool is_over(const HeldQuery& held, const Engine& engine, HeldQueries::Clock::time_point now) {
  if (now >= held.deadline) return true;
  try {
    return HeldQueries::poses_are_there(engine, held.asked.header, held.query);
  } catch (const QueryError&) {  // another scene: said where the query begins
    return true;
  } catch (const Refusal&) {  // likewise
    return true;
  }
}

}  // namespace

Refusal poses_late(const QueryOptions& query, bool waited) {
  const std::string poses = "no poses with stamp " + std::to_string(query.min_pose_stamp_ns) + " or newer ";
  if (!waited) return {wire::ErrorCode::kPosesLate, poses + "are there"};
  const double ms = 1e-6 * static_cast<double>(query.pose_wait_ns);
  return {wire::ErrorCode::kPosesLate, poses + "came within " + std::to_string(ms) + " ms"};
}

bool HeldQueries::poses_are_there(const Engine& engine, const wire::FrameHeader& request, const QueryOptions& query) {
  if (query.wait_for != kEveryBody) check_scene(engine, request, std::array{query.wait_for});
  return engine.poses_reach(query.wait_for, query.min_pose_stamp_ns);
}

void HeldQueries::hold(const wire::FrameHeader& request, const QueryOptions& query, std::span<const std::byte> payload,
                       std::unique_ptr<ReplySink>& sink, Quotas& quotas, const Engine& engine,
                       Clock::time_point received) {
  if (query.pose_wait_ns == 0) throw poses_late(query, false);
  const std::uint64_t client = sink->client();
  quotas.check_bytes(client, payload.size(), sink->unsent_bytes());
  HeldQuery held{{nullptr, request, quotas.take(client, payload.size())},
                 query,
                 std::vector<std::uint64_t>((payload.size() + 7) / 8),
                 payload.size(),
                 received,
                 received + std::chrono::nanoseconds(query.pose_wait_ns)};
  std::memcpy(held.words.data(), payload.data(), payload.size());
  if (held_.empty()) looked_at_revision_ = engine.pose_revision();  // the others have not been looked at yet
  deadline_ = std::min(deadline_, held.deadline);
  held_.push_back(std::move(held));
  held_.back().asked.sink = std::move(sink);  // now that nothing can fail any more
}

/// Puts those that are over behind the others, the last one first. Returns how many stay.
std::size_t HeldQueries::part(const Engine& engine, Clock::time_point now) {
  const std::uint64_t revision = engine.pose_revision();
  if (revision == looked_at_revision_ && now < deadline_) return held_.size();
  looked_at_revision_ = revision;
  const auto first = std::stable_partition(held_.begin(), held_.end(),
                                           [&](const HeldQuery& held) { return !is_over(held, engine, now); });
  std::reverse(first, held_.end());
  deadline_ = Clock::time_point::max();
  for (auto held = held_.begin(); held != first; ++held) deadline_ = std::min(deadline_, held->deadline);
  return static_cast<std::size_t>(first - held_.begin());
}

std::size_t HeldQueries::drop_gone() {
  const auto dropped = std::erase_if(held_, [](const HeldQuery& held) { return !held.asked.sink->alive(); });
  if (held_.empty()) deadline_ = Clock::time_point::max();
  return dropped;
}

}  // namespace clearance
