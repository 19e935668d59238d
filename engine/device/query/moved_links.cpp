#include "engine/device/query/moved_links.h"

namespace clearance::cuda {

MovedLinks::MovedLinks(const Plan& plan) : joints_(static_cast<std::uint32_t>(plan.joints.size())) {
  for (const LinkMotion& motion : plan.motions) add(motion);
}

void MovedLinks::add(const LinkMotion& motion) {
  const SceneRobot& robot = motion.robot();
  const std::vector<KinematicStep>& steps = robot.kinematics.steps();
  const auto roots = static_cast<std::uint32_t>(robot.kinematics.roots().size());
  robots_.push_back({static_cast<std::uint32_t>(steps_.size()), static_cast<std::uint32_t>(steps.size()),
                     static_cast<std::uint32_t>(columns_.size()), roots, frame_count_});
  steps_.insert(steps_.end(), steps.begin(), steps.end());
  const std::size_t first = columns_.size();
  for (std::size_t c = 0; c < motion.positions().size(); ++c) {
    const RobotColumn& column = robot.model.columns[c];
    columns_.push_back({motion.positions()[c], column.lower, column.upper, kNone, motion.column_facts()[c]});
  }
  for (const LinkMotion::Moving& m : motion.moving()) columns_[first + m.column].at = m.at;
  for (const std::uint32_t link : motion.links()) {  // links are never roots: a joint leads to each
    const auto step = static_cast<std::uint32_t>(robot.kinematics.step_of(link) - steps.data());
    frames_.push_back(frame_count_ + roots + step);
  }
  frame_count_ += roots + static_cast<std::uint32_t>(steps.size());
}

RobotsSetup MovedLinks::setup() const {
  return {steps_, columns_, robots_, frame_count_, joints_};
}

}  // namespace clearance::cuda
