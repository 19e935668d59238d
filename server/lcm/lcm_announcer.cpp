#include "server/lcm/lcm_announcer.h"

#include <cstring>
#include <utility>
#include <vector>

#include "server/lcm/lcm_translate.h"

namespace clearance {
namespace {

constexpr std::chrono::seconds kPeriod{1};

}  // namespace

int LcmAnnouncer::serve() {
  handed_in_ = 0;
  const auto now = Clock::now();
  const std::uint64_t revision = handler_.engine().scene_revision();
  if (now >= next_period_ || revision != scene_revision_) {
    scene_revision_ = revision;
    request_scene();
    if (now >= next_period_) request_states(), request_status();
    next_period_ = now + kPeriod;
  }
  // A dropped request must not end the distances for good.
  if (distances_pending_ && now - requested_at_ > kLcmRepeatInterval) distances_pending_ = false;
  if (distances_wanted() && now >= next_distances_) {
    pose_revision_ = handler_.engine().pose_revision();
    next_distances_ = now + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / distances_hz_));
    request_distances();
  }
  return handed_in_;
}

std::optional<LcmAnnouncer::Clock::time_point> LcmAnnouncer::due() const {
  return distances_wanted() ? std::optional(next_distances_) : std::nullopt;
}

void LcmAnnouncer::hand_in(std::span<const std::byte> frame, Take take) {
  wire::FrameHeader header;
  std::memcpy(&header, frame.data(), sizeof header);
  ++handed_in_;
  handler_.on_frame(header, frame.subspan(sizeof header),
                    std::make_unique<LcmSink>(link_, own_client_, guarded(std::move(take))));
}

void LcmAnnouncer::request(wire::FrameType type, Take take) {
  const wire::FrameHeader header = wire::make_header(type, 0, 0);
  hand_in(std::as_bytes(std::span(&header, 1)), std::move(take));
}

/// Catches errors, as an error frame or a damaged one must not end the loop.
LcmSink::Deliver LcmAnnouncer::guarded(Take take) {
  return [this, take = std::move(take)](LcmLink& link, FrameBytes frame) {
    try {
      take(link, frame.span());
    } catch (const wire::WireError& error) {
      metrics_.log_rate_limited("own", std::string("cannot publish: ") + error.what());
    }
  };
}

void LcmAnnouncer::request_scene() {
  request(wire::FrameType::kDescribe, [this](LcmLink& link, std::span<const std::byte> frame) {
    auto messages = scene_messages(frame, link.server_id);
    backend_ = messages.front().backend;
    link.push_all(link.announcements, "CLEARANCE_SCENE", std::move(messages));
  });
}

void LcmAnnouncer::request_states() {
  request(wire::FrameType::kGetStates, [this](LcmLink& link, std::span<const std::byte> frame) {
    link.push_all(link.announcements, "CLEARANCE_STATES",
                  states_messages(frame, link.server_id, ++states_sequence_, scene_revision_));
  });
}

void LcmAnnouncer::request_status() {
  request(wire::FrameType::kGetStats, [this](LcmLink& link, std::span<const std::byte> frame) {
    auto message = status_message(frame, link.server_id);
    message.sequence = ++status_sequence_;
    message.uptime_ns = (Clock::now() - opened_).count();
    message.scene_revision = static_cast<std::int64_t>(scene_revision_);
    message.backend = backend_;
    link.push_all(link.announcements, "CLEARANCE_STATUS", std::vector{std::move(message)});
  });
}

bool LcmAnnouncer::distances_wanted() const {
  return distances_hz_ > 0 && !distances_pending_ && handler_.engine().pose_revision() != pose_revision_;
}

void LcmAnnouncer::request_distances() {
  distances_pending_ = true;
  requested_at_ = Clock::now();
  hand_in(nearest_query_frame(), [this](LcmLink& link, std::span<const std::byte> frame) {
    distances_pending_ = false;
    link.push_all(link.outbox, "CLEARANCE_DISTANCES", distances_messages(frame, link.server_id, ++distances_sequence_));
  });
}

}  // namespace clearance
