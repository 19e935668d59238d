#include "server/lcm/lcm_figures.h"

#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {

LcmFigures::LcmFigures(Inbox& inbox)
    : messages(inbox.counter("lcm.messages")),
      bad(inbox.counter("lcm.bad_messages")),
      poses(inbox.counter("lcm.pose_messages")),
      wrong_scene(inbox.counter("lcm.wrong_scene")),
      unknown(inbox.counter("lcm.unknown_bodies")),
      gaps(inbox.counter("lcm.gaps")),
      reordered(inbox.counter("lcm.reordered")),
      repeated(inbox.counter("lcm.repeated")),
      restarts(inbox.counter("lcm.restarts")),
      contested(inbox.counter("lcm.contested")),
      bad_stamps(inbox.counter("lcm.bad_stamps")),
      not_allowed(inbox.counter("lcm.poses_not_allowed")),
      publishers(inbox.counter("lcm.publishers")),
      queries(inbox.counter("lcm.queries")),
      frames(inbox.counter("lcm.frames")),
      clouds(inbox.counter("lcm.clouds")),
      given_up(inbox.counter("lcm.frames_given_up")),
      replies(inbox.counter("lcm.replies")),
      dropped(inbox.counter("lcm.replies_dropped")),
      sent(inbox.counter("lcm.sent")),
      failed(inbox.counter("lcm.send_errors")),
      other_daemons(inbox.counter("lcm.other_daemons")) {}

void LcmFigures::complain(const char* kind, const std::string& what) {
  Complaint& complaint = complaints_[kind];
  ++complaint.times;
  const auto now = std::chrono::steady_clock::now();
  if (complaint.times > 1 && now - complaint.last < kLcmSayAgain) return;
  const std::uint64_t unsaid = complaint.times - complaint.said - 1;
  log::warn("event=lcm_{} more={} text=\"{}\"", kind, unsaid, log_text(what));
  complaint.last = now;
  complaint.said = complaint.times;
}

}  // namespace clearance
