#include "server/lcm_publishers.h"

#include <algorithm>

namespace clearance {

PublisherLog::Note PublisherLog::note(int channel, std::int64_t publisher, std::int64_t sequence,
                                      Clock::time_point now) {
  const auto [it, is_new] = publishers_.try_emplace({publisher, channel}, Publisher{sequence, now});
  if (is_new) {
    if (publishers_.size() > kMaxPublishers) {
      const auto silent = std::min_element(publishers_.begin(), publishers_.end(),
                                           [](const auto& a, const auto& b) { return a.second.last < b.second.last; });
      publishers_.erase(silent);
    }
    return {Verdict::kNew, 0};
  }
  Publisher& known = it->second;
  const bool was_silent = now - known.last > kSilence;
  known.last = now;
  if (sequence > known.sequence) {
    // Unsigned: sequences of the far ends of the range must not overflow.
    const std::uint64_t missing = static_cast<std::uint64_t>(sequence) - static_cast<std::uint64_t>(known.sequence) - 1;
    known.sequence = sequence;
    return {missing == 0 ? Verdict::kNext : Verdict::kGap, missing};
  }
  if (sequence == known.sequence) return {Verdict::kRepeated, 0};
  const std::uint64_t back = static_cast<std::uint64_t>(known.sequence) - static_cast<std::uint64_t>(sequence);
  if (was_silent || back >= static_cast<std::uint64_t>(kRestartStep)) {
    known.sequence = sequence;
    return {Verdict::kRestart, 0};
  }
  return {Verdict::kOld, 0};
}

std::vector<std::uint32_t> OwnerLog::note(std::int64_t publisher, std::span<const BodyPose> poses,
                                          Clock::time_point now) {
  std::vector<std::uint32_t> contested;
  for (const BodyPose& pose : poses) {
    if (pose.body >= owners_.size()) continue;
    Owner& owner = owners_[pose.body];
    if (owner.now != publisher) {
      if (owner.before == publisher && now - owner.before_last < kWindow) contested.push_back(pose.body);
      owner.before = owner.now;
      owner.before_last = owner.last;
      owner.now = publisher;
    }
    owner.last = now;
  }
  return contested;
}

}  // namespace clearance
