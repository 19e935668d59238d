#include "server/lcm/lcm_publishers.h"

#include <algorithm>

#include "server/requests/transport.h"

namespace clearance {

PublisherLog::Note PublisherLog::note(int channel, std::int64_t publisher, std::int64_t sequence, std::int64_t stamp_ns,
                                      Clock::time_point now) {
  const auto [it, is_new] = publishers_.try_emplace({publisher, channel}, Publisher{sequence, stamp_ns, 0, now});
  if (is_new) {
    if (publishers_.size() > kMaxPublishers) {
      const auto silent = std::min_element(publishers_.begin(), publishers_.end(),
                                           [](const auto& a, const auto& b) { return a.second.last < b.second.last; });
      publishers_.erase(silent);
    }
    return {Sequencing::kNew, 0};
  }
  Publisher& known = it->second;
  if (sequence > known.sequence) {
    if (stamp_ns != 0 && stamp_ns < known.begun_ns) return {Sequencing::kOld, 0};
    // Unsigned, so that sequences at both ends of the range do not overflow.
    const std::uint64_t missing = static_cast<std::uint64_t>(sequence) - static_cast<std::uint64_t>(known.sequence) - 1;
    known.sequence = sequence;
    known.newest_ns = std::max(known.newest_ns, stamp_ns);
    known.last = now;
    return {missing == 0 ? Sequencing::kNext : Sequencing::kGap, missing};
  }
  if (known.newest_ns != 0 && stamp_ns > known.newest_ns) {
    known = {sequence, stamp_ns, stamp_ns, now};
    return {Sequencing::kRestart, 0};
  }
  return {sequence == known.sequence ? Sequencing::kRepeated : Sequencing::kOld, 0};
}

std::vector<std::uint32_t> OwnerLog::note(std::int64_t publisher, std::span<const std::uint32_t> ids,
                                          Clock::time_point now) {
  std::vector<std::uint32_t> contested;
  for (const std::uint32_t id : ids) {
    if (id >= owners_.size()) continue;
    auto& owners = owners_[id];
    auto known = std::find_if(owners.begin(), owners.end(), [&](const Owner& o) { return o.publisher == publisher; });
    const bool was_here = known != owners.end() && now - known->last < kWindow;
    if (known != owners.begin()) {
      if (was_here) contested.push_back(id);
      if (known == owners.end()) --known;  // replaces the one silent for longest
      std::rotate(owners.begin(), known, known + 1);
    }
    owners.front() = {publisher, now};
  }
  return contested;
}

std::uint64_t LcmClients::number_of(std::int64_t lcm_client) {
  if (numbers_.size() >= kMaxClients && !numbers_.contains(lcm_client)) numbers_.clear();
  std::uint64_t& number = numbers_[lcm_client];
  if (number == 0) number = next_client_id();
  return number;
}

}  // namespace clearance
