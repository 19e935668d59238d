#include "engine/robot/link_twists.h"

#include <cassert>

namespace clearance {

LinkTwists::LinkTwists(const Kinematics& robot) : robot_(robot) {
  for (const KinematicStep& step : robot.steps()) {
    const std::size_t roots = robot.roots().size();
    links_.push_back(step.from < roots ? robot.roots()[step.from] : robot.steps()[step.from - roots].link);
    const Quaternion<double>& q = step.still;  // its inverse, times turning, is (0, axis)
    const Quaternion<double> axis = product(Quaternion<double>{q.w, -q.x, -q.y, -q.z}, step.turning);
    axes_.push_back({axis.x, axis.y, axis.z});
  }
}

void LinkTwists::at(std::span<const Pose> poses, std::span<const double> change, std::span<Twist> twists) const {
  assert(poses.size() == robot_.links() && twists.size() == robot_.links());
  using Kind = KinematicStep::Kind;
  const auto turned_by = [&](std::uint32_t link, const Vec3d& v) {
    const Pose& X = poses[link];
    return turned(Quaternion<double>{X.qw, X.qx, X.qy, X.qz}, v);
  };
  for (const std::uint32_t root : robot_.roots()) twists[root] = {};
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const KinematicStep& step = robot_.steps()[i];
    const std::uint32_t from = links_[i], link = step.link;
    const Twist& carrier = twists[from];
    Twist& own = twists[link];
    own.turn = carrier.turn;
    own.shift = carrier.shift + cross(carrier.turn, poses[link].translation - poses[from].translation);
    if (step.kind == Kind::kFixed) continue;
    const double scale = step.mimics ? step.multiplier : 1;
    const double first = scale * change[step.column];
    if (step.kind == Kind::kTurning) own.turn += turned_by(link, axes_[i]) * first;
    if (step.kind == Kind::kSliding) own.shift += turned_by(from, step.along[0]) * first;
    if (step.kind != Kind::kPlanar) continue;
    own.shift += turned_by(from, step.along[0] * first + step.along[1] * change[step.column + 1]);
    own.turn += turned_by(link, axes_[i]) * change[step.column + 2];
  }
}

}  // namespace clearance
