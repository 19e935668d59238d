#include "server/lcm/lcm_metrics.h"

#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {

LcmMetrics::LcmMetrics(RequestHandler& handler)
    : messages(handler.counter("lcm.messages")),
      bad(handler.counter("lcm.bad_messages")),
      poses(handler.counter("lcm.pose_messages")),
      unknown(handler.counter("lcm.unknown_bodies")),
      gaps(handler.counter("lcm.gaps")),
      reordered(handler.counter("lcm.reordered")),
      repeated(handler.counter("lcm.repeated")),
      restarts(handler.counter("lcm.restarts")),
      contested(handler.counter("lcm.contested")),
      bad_stamps(handler.counter("lcm.bad_stamps")),
      not_allowed(handler.counter("lcm.poses_not_allowed")),
      publishers(handler.counter("lcm.publishers")),
      queries(handler.counter("lcm.queries")),
      frames(handler.counter("lcm.frames")),
      clouds(handler.counter("lcm.clouds")),
      given_up(handler.counter("lcm.frames_given_up")),
      replies(handler.counter("lcm.replies")),
      dropped(handler.counter("lcm.replies_dropped")),
      sent(handler.counter("lcm.sent")),
      failed(handler.counter("lcm.send_errors")),
      other_daemons(handler.counter("lcm.other_daemons")) {}

void LcmMetrics::log_rate_limited(const char* kind, const std::string& what) {
  Suppressed& entry = suppressed_[kind];
  ++entry.times;
  const auto now = std::chrono::steady_clock::now();
  if (entry.times > 1 && now - entry.last < kLcmRepeatInterval) return;
  const std::uint64_t unsaid = entry.times - entry.said - 1;
  log::warn("event=lcm_{} more={} text=\"{}\"", kind, unsaid, log_text(what));
  entry.last = now;
  entry.said = entry.times;
}

}  // namespace clearance
