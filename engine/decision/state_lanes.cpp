#include "engine/decision/state_lanes.h"

#include <algorithm>
#include <cassert>

namespace clearance {

bool are_placed(const LinkMotion& motion) {
  const std::vector<std::uint8_t> facts = bits_along_links(motion.robot(), motion.column_facts());
  return std::none_of(motion.links().begin(), motion.links().end(),
                      [&](std::uint32_t link) { return facts[link] & (kLinkUnplaced | kLinkBad); });
}

StateLanes::StateLanes(const CoverPlan& covers, const Plan& plan)
    : covers_(covers), plan_(plan), can_place_(plan.given_bodies == 0) {
  std::vector<const double*> of_pose(plan.given_bodies);
  for (const LinkMotion& motion : plan.motions) {
    can_place_ &= are_placed(motion);
    std::vector<DoubleInLanes>& positions = positions_.emplace_back();
    for (const double position : motion.positions()) std::fill_n(positions.emplace_back().lane, kMostLanes, position);
    const LaneKinematics& robot = robots_.emplace_back(motion.robot().kinematics);
    for (const std::uint32_t link : motion.links()) of_pose.push_back(robot.frames()[link].part[0].lane);
  }
  const std::span bodies(covers.view().bodies, covers.view().body_count);
  for (const DecidedBody& body : bodies) {
    can_place_ &= body.is_direct;
    frames_.push_back(body.is_direct ? of_pose[body.pose] : nullptr);
  }
}

void StateLanes::place(std::uint64_t first, std::size_t count) {
  assert(can_place_ && count <= kMostLanes);
  const std::size_t joints = plan_.joints.size();
  for (std::size_t k = 0; k < count; ++k)
    usable_[k] = covers_.holds_for(plan_.positions.subspan((first + k) * joints, joints));
  for (std::size_t m = 0; m < robots_.size(); ++m) {
    for (const LinkMotion::Moving& moving : plan_.motions[m].moving())
      for (std::size_t k = 0; k < count; ++k) {
        const double position = plan_.positions[(first + k) * joints + moving.at];
        const bool is_good = -kMaxPosition <= position && position <= kMaxPosition;
        positions_[m][moving.column].lane[k] = is_good ? position : 0;
        usable_[k] &= is_good;
      }
    robots_[m].place(positions_[m]);
  }
}

}  // namespace clearance
