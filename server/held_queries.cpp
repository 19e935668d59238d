// Queries that wait for poses (QueryOptions::min_pose_stamp_ns): held aside, looked at when poses have come or time is
// up.
#include <algorithm>
#include <cstring>

#include "loop_task.h"

namespace clearance {

using wire::ErrorCode;

std::size_t Loop::held() const {
  return held_.size();
}

void Loop::hold_query(const wire::FrameHeader& header, const QueryOptions& query,
                      std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink) {
  if (query.pose_wait_ns == 0)
    throw Refusal{ErrorCode::kPosesLate,
                  "no poses with stamp " + std::to_string(query.min_pose_stamp_ns) + " or newer are there"};
  check_room_for_bytes(*sink, payload.size());
  Usage& usage = waiting_per_client_[sink->client()];
  Held held{nullptr, header,      std::vector<std::uint64_t>((payload.size() + 7) / 8),      payload.size(),
            query,   turn_began_, turn_began_ + std::chrono::nanoseconds(query.pose_wait_ns)};
  std::memcpy(held.payload.data(), payload.data(), payload.size());
  held_deadline_ = held_.empty() ? held.deadline : std::min(held_deadline_, held.deadline);
  held_until_revision_ = engine_->pose_revision();
  held_.push_back(std::move(held));
  held_.back().sink = std::move(sink);
  ++usage.requests;
  usage.bytes += payload.size();
  waiting_bytes_ += payload.size();
  ++counter("queries.held_back");
}

/// Begins those whose poses are there, and refuses those whose time is up. Returns whether there were any.
bool Loop::look_at_held() {
  const bool time_is_up = turn_began_ >= held_deadline_;
  const std::uint64_t revision = engine_->pose_revision();
  if (revision == held_until_revision_ && !time_is_up) return false;
  held_until_revision_ = revision;
  const auto stays = [&](const Held& held) {
    if (turn_began_ >= held.deadline) return false;
    try {
      check_wait_for(held.request, held.query);
      return !engine_->poses_reach(held.query.wait_for, held.query.min_pose_stamp_ns);
    } catch (const QueryError&) {  // another scene: said where the query begins
      return false;
    } catch (const Refusal&) {  // likewise
      return false;
    }
  };
  const auto first = std::stable_partition(held_.begin(), held_.end(), stays);
  std::reverse(first, held_.end());  // taken from the back, those that came first first
  const auto kept = static_cast<std::size_t>(first - held_.begin());
  held_deadline_ = Clock::time_point::max();
  for (std::size_t i = 0; i < kept; ++i) held_deadline_ = std::min(held_deadline_, held_[i].deadline);
  const bool any = held_.size() > kept;
  while (held_.size() > kept) {
    Held held = std::move(held_.back());
    held_.pop_back();
    ReplySink& way_back = *held.sink;  // lives on in a Task
    waiting_bytes_ -= held.payload_bytes;
    leave(way_back.client(), held.payload_bytes);
    guarded(way_back, held.request, [&] {
      check_wait_for(held.request, held.query);
      if (!engine_->poses_reach(held.query.wait_for, held.query.min_pose_stamp_ns))
        throw Refusal{ErrorCode::kPosesLate,
                      "no poses with stamp " + std::to_string(held.query.min_pose_stamp_ns) + " or newer came within " +
                          std::to_string(1e-6 * static_cast<double>(held.query.pose_wait_ns)) + " ms"};
      const auto payload = std::as_bytes(std::span(held.payload)).first(held.payload_bytes);
      begin_query(held.request, wire::parse_query(held.request, payload), payload.size(), held.sink, held.received);
    });
  }
  return any;
}

void Loop::drop_held_of_the_gone() {
  std::erase_if(held_, [this](const Held& held) {
    if (held.sink->alive()) return false;
    waiting_bytes_ -= held.payload_bytes;
    leave(held.sink->client(), held.payload_bytes);
    ++dropped_;
    ++counter("queries.dropped");
    return true;
  });
}

}  // namespace clearance
