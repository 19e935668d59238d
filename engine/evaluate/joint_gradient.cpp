#include "engine/evaluate/joint_gradient.h"

#include <algorithm>
#include <limits>

namespace clearance {

namespace {

using Kind = KinematicStep::Kind;

constexpr std::uint32_t kUnknown = ~std::uint32_t{0};

}  // namespace

JointGradient::JointGradient(const engine::Scene& scene, const Plan& plan)
    : JointGradient(scene, *plan.snapshot, plan.joints, plan.moved) {}

JointGradient::JointGradient(const engine::Scene& scene, const PoseSnapshot& snapshot,
                             std::span<const std::uint32_t> joints, std::span<const std::uint32_t> bodies)
    : scene_(scene), snapshot_(snapshot), joints_(joints.size()), mover_of_(scene.bodies().size(), kUnknown) {
  std::vector<std::uint32_t> at_of_joint(scene.joints().size(), kNone);
  for (std::uint32_t i = 0; i < joints.size(); ++i) at_of_joint[joints[i]] = i;
  for (const std::uint32_t body : bodies) find_mover(body, at_of_joint);
  std::replace(mover_of_.begin(), mover_of_.end(), kUnknown, kNone);  // bodies that nothing moves
}

std::uint32_t JointGradient::carrier_of(std::uint32_t body) const {
  const Body& of = scene_.bodies()[body];
  if (of.robot == kNone) return snapshot_.parent[body];
  const SceneRobot& robot = *scene_.robots()[of.robot];
  const KinematicStep* const step = robot.kinematics.step_of(of.link);
  return step ? robot.bodies[robot.kinematics.carrier_of(*step)] : snapshot_.parent[body];
}

// Finds the movers of a body and of all bodies below it.
void JointGradient::find_mover(std::uint32_t body, std::span<const std::uint32_t> at_of_joint) {
  std::vector<std::uint32_t> way;
  for (; body != kNone && mover_of_[body] == kUnknown; body = carrier_of(body)) way.push_back(body);
  std::uint32_t above = body == kNone ? kNone : mover_of_[body];
  for (auto b = way.rbegin(); b != way.rend(); ++b) above = mover_of_[*b] = add_mover(*b, above, at_of_joint);
}

// Adds a mover of the body itself if the query moves any of its columns. Otherwise returns the one above.
std::uint32_t JointGradient::add_mover(std::uint32_t body, std::uint32_t above,
                                       std::span<const std::uint32_t> at_of_joint) {
  const Body& of = scene_.bodies()[body];
  if (of.robot == kNone) return above;
  const SceneRobot& robot = *scene_.robots()[of.robot];
  const KinematicStep* const step = robot.kinematics.step_of(of.link);
  if (!step || step->kind == Kind::kFixed) return above;
  const Quaternion<double>& q = step->still;
  const Quaternion<double> axis = product(Quaternion<double>{q.w, -q.x, -q.y, -q.z}, step->turning);
  JointMover mover{step->kind == Kind::kPlanar    ? 2u
                   : step->kind == Kind::kSliding ? 1u
                                                  : 0u,
                   step->kind != Kind::kSliding,
                   {kNone, kNone, kNone},
                   robot.bodies[step->link],
                   robot.bodies[robot.kinematics.carrier_of(*step)],
                   above,
                   0,
                   step->mimics ? step->multiplier : 1,
                   {step->along[0], step->along[1]},
                   {axis.x, axis.y, axis.z}};
  mover.depth = above == kNone ? 0 : movers_[above].depth + 1;
  for (std::uint32_t c = 0; c < (step->kind == Kind::kPlanar ? 3u : 1u); ++c)
    mover.at[c] = at_of_joint[robot.first_joint + step->column + c];
  if (std::all_of(mover.at, mover.at + 3, [](std::uint32_t at) { return at == kNone; })) return above;
  movers_.push_back(mover);
  return static_cast<std::uint32_t>(movers_.size() - 1);
}

void JointGradient::write(const BodyPoses& placement, BodyPair pair, const PairAnswer& answer, double* out) const {
  const std::size_t n = scene_.bodies().size();
  if (pair.a >= n || pair.b >= n) {
    std::fill_n(out, joints_, std::numeric_limits<double>::quiet_NaN());
    return;
  }
  const auto pose_of = [&](std::uint32_t body) -> const PoseMatrix& { return placement[body].pose; };
  write_joint_gradient(movers_.data(), mover_of_[pair.a], mover_of_[pair.b], answer, pose_of(pair.a).t_w,
                       pose_of(pair.b).t_w, pose_of, static_cast<std::uint32_t>(joints_), out);
}

}  // namespace clearance
