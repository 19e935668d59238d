#include "engine/query/distance/row_flags.h"

#include <algorithm>

namespace clearance {

namespace {

std::uint16_t flag_of(const Pose& pose) {
  return check(pose) == PoseQuality::kRenormalised ? kFlagRenormalised : 0;
}

}  // namespace

RowFlags::RowFlags(const Plan& plan) : plan_(plan) {
  for (const BodyPlacement& placed : plan.snapshot->placed)
    flags_.push_back(static_cast<std::uint16_t>((placed.renormalised ? kFlagRenormalised : 0) |
                                                (placed.beyond_limits ? kFlagBeyondLimits : 0)));
  take_moved();
}

// The flags of moved bodies, through joints that stay and poses relative to their parents.
void RowFlags::take_moved() {
  const PoseSnapshot& snapshot = *plan_.snapshot;
  for (const std::uint32_t b : plan_.moved)
    flags_[b] =
        static_cast<std::uint16_t>(flag_of(snapshot.local[b]) | (snapshot.beyond_limits[b] ? kFlagBeyondLimits : 0));
  std::size_t m = 0;
  for (; m < plan_.given_bodies; ++m) flags_[plan_.bodies[m]] = 0;
  for (const LinkMotion& motion : plan_.motions) {
    const std::vector<std::uint8_t> facts = bits_along_links(motion.robot(), motion.column_facts());
    for (const std::uint32_t link : motion.links())
      flags_[plan_.bodies[m++]] = facts[link] & kLinkBeyondLimits ? kFlagBeyondLimits : 0;
  }
  for (const std::uint32_t b : plan_.moved)
    if (const std::uint32_t parent = snapshot.parent[b]; parent != kNone)
      flags_[b] |= flags_[parent] & kFlagBeyondLimits;
}

bool RowFlags::are_changed_by(std::uint64_t configuration) const {
  const auto given = plan_.configurations.subspan(configuration * plan_.given_bodies, plan_.given_bodies);
  if (std::any_of(given.begin(), given.end(), [](const Pose& pose) { return flag_of(pose) != 0; })) return true;
  const auto row = plan_.positions.subspan(configuration * plan_.joints.size(), plan_.joints.size());
  return std::any_of(plan_.motions.begin(), plan_.motions.end(), [&](const LinkMotion& motion) {
    const std::vector<LinkMotion::Moving>& moving = motion.moving();
    return std::any_of(moving.begin(), moving.end(), [&](const LinkMotion::Moving& m) {
      return position_fact(motion.robot().model.columns[m.column], row[m.at]) != 0;
    });
  });
}

}  // namespace clearance
