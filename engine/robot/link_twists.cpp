#include "engine/robot/link_twists.h"

#include <cassert>

namespace clearance {

LinkTwists::LinkTwists(const Kinematics& robot) : robot_(robot) {
  for (const KinematicStep& step : robot.steps()) {
    const std::size_t roots = robot.roots().size();
    links_.push_back(step.from < roots ? robot.roots()[step.from] : robot.steps()[step.from - roots].link);
    axes_.push_back(axis_of_step(step));
  }
}

void LinkTwists::at(std::span<const Pose> poses, std::span<const double> change, std::span<Twist> twists) const {
  assert(poses.size() == robot_.links() && twists.size() == robot_.links());
  const auto frame_of = [&](std::uint32_t link) -> KinematicFrame<double> {
    const Pose& X = poses[link];
    return {{X.qw, X.qx, X.qy, X.qz}, X.translation};
  };
  const auto of_column = [&](std::uint32_t column) { return change[column]; };
  for (const std::uint32_t root : robot_.roots()) twists[root] = {};
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const KinematicStep& step = robot_.steps()[i];
    const std::uint32_t from = links_[i], link = step.link;
    twists[link] = twist_of_step(step, axes_[i], frame_of(from), twists[from], frame_of(link), of_column);
  }
}

}  // namespace clearance
