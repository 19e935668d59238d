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
    : covers_(covers),
      plan_(plan),
      can_place_(plan.given_bodies == 0),
      cells_(kMostLanes * covers.view().tabled_count),
      poses_(plan.bodies.size()) {
  std::vector<const double*> of_pose(plan.given_bodies);
  for (const LinkMotion& motion : plan.motions) {
    can_place_ &= are_placed(motion);
    std::vector<DoubleInLanes>& positions = positions_.emplace_back();
    for (const double position : motion.positions()) std::fill_n(positions.emplace_back().lane, kMostLanes, position);
    const LaneKinematics& robot = robots_.emplace_back(motion.robot().kinematics);
    row_.emplace_back(motion.positions().begin(), motion.positions().end());
    links_.emplace_back(motion.robot().kinematics.links());
    for (const std::uint32_t link : motion.links()) of_pose.push_back(robot.frames()[link].part[0].lane);
  }
  const std::span bodies(covers.view().bodies, covers.view().body_count);
  for (const DecidedBody& body : bodies) {
    can_place_ &= body.is_direct;
    frames_.push_back(body.is_direct ? of_pose[body.pose] : nullptr);
  }
}

// Finds the cells of a state, as state k, before its bodies are placed: meanwhile they arrive from memory. Returns the
// state's positions.
std::span<const double> StateLanes::find_cells(std::uint64_t state, std::size_t k) {
  const std::span<const double> positions = plan_.positions.subspan(state * plan_.joints.size(), plan_.joints.size());
  const std::span tabled(covers_.view().tabled, covers_.view().tabled_count);
  std::transform(tabled.begin(), tabled.end(), cells_.begin() + static_cast<std::ptrdiff_t>(k * tabled.size()),
                 [&](const TabledPair& pair) { return pair.find(positions.data()); });
  return positions;
}

void StateLanes::place(std::uint64_t first, std::size_t count) {
  assert(can_place_ && count <= kMostLanes);
  const std::size_t joints = plan_.joints.size();
  for (std::size_t k = 0; k < count; ++k) usable_[k] = covers_.holds_for(find_cells(first + k, k));
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

const Pose* StateLanes::place_one(std::uint64_t state) {
  assert(can_place_);
  const std::span<const double> positions = find_cells(state, 0);
  bool usable = covers_.holds_for(positions);
  Pose* body = poses_.data();
  for (std::size_t m = 0; m < row_.size(); ++m) {
    for (const LinkMotion::Moving& moving : plan_.motions[m].moving()) {
      const double position = positions[moving.at];
      const bool is_good = -kMaxPosition <= position && position <= kMaxPosition;
      row_[m][moving.column] = is_good ? position : 0;
      usable &= is_good;
    }
    Status status;
    plan_.motions[m].robot().kinematics.place(row_[m], {}, links_[m], {&status, 1});
    usable &= status == Status::kOk;
    for (const std::uint32_t link : plan_.motions[m].links()) *body++ = links_[m][link];
  }
  usable_[0] = usable;
  return poses_.data();
}

}  // namespace clearance
