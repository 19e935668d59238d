#include "engine/query/joint_gradient.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace clearance {

namespace {

using Kind = KinematicStep::Kind;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint32_t kUnknown = ~std::uint32_t{0};

}  // namespace

JointGradient::JointGradient(const Scene& scene, const Plan& plan)
    : scene_(scene),
      snapshot_(*plan.snapshot),
      joints_(plan.joints.size()),
      mover_of_(scene.bodies().size(), kUnknown) {
  std::vector<std::uint32_t> at_of_joint(scene.joints().size(), kNone);
  for (std::uint32_t i = 0; i < plan.joints.size(); ++i) at_of_joint[plan.joints[i]] = i;
  for (const std::uint32_t body : plan.moved) find_mover(body, at_of_joint);
  std::replace(mover_of_.begin(), mover_of_.end(), kUnknown, kNone);  // of bodies that nothing moves
}

// What a body stands on: of a link the one before it, else what it follows; kNone: nothing.
std::uint32_t JointGradient::carrier_of(std::uint32_t body) const {
  const Body& of = scene_.bodies()[body];
  if (of.robot == kNone) return snapshot_.parent[body];
  const SceneRobot& robot = *scene_.robots()[of.robot];
  const KinematicStep* const step = robot.kinematics.step_of(of.link);
  return step ? robot.bodies[robot.kinematics.carrier_of(*step)] : snapshot_.parent[body];
}

// ... and those of all that carry it.
void JointGradient::find_mover(std::uint32_t body, std::span<const std::uint32_t> at_of_joint) {
  std::vector<std::uint32_t> way;
  for (; body != kNone && mover_of_[body] == kUnknown; body = carrier_of(body)) way.push_back(body);
  std::uint32_t above = body == kNone ? kNone : mover_of_[body];
  for (auto b = way.rbegin(); b != way.rend(); ++b) above = mover_of_[*b] = add_mover(*b, above, at_of_joint);
}

// The one that moves a body by itself, if the query moves any of its columns; else what is above.
std::uint32_t JointGradient::add_mover(std::uint32_t body, std::uint32_t above,
                                       std::span<const std::uint32_t> at_of_joint) {
  const Body& of = scene_.bodies()[body];
  if (of.robot == kNone) return above;
  const SceneRobot& robot = *scene_.robots()[of.robot];
  const KinematicStep* const step = robot.kinematics.step_of(of.link);
  if (!step || step->kind == Kind::kFixed) return above;
  const Quaternion<double>& q = step->still;
  const Quaternion<double> axis = product(Quaternion<double>{q.w, -q.x, -q.y, -q.z}, step->turning);
  Mover mover{&robot, step, {kNone, kNone, kNone}, {axis.x, axis.y, axis.z}, above, 0};
  mover.depth = above == kNone ? 0 : movers_[above].depth + 1;
  for (std::uint32_t c = 0; c < (step->kind == Kind::kPlanar ? 3u : 1u); ++c)
    mover.at[c] = at_of_joint[robot.first_joint + step->column + c];
  if (std::all_of(mover.at.begin(), mover.at.end(), [](std::uint32_t at) { return at == kNone; })) return above;
  movers_.push_back(mover);
  return static_cast<std::uint32_t>(movers_.size() - 1);
}

void JointGradient::write(const Placement& placement, BodyPair pair, const PairAnswer& answer, double* out) const {
  const std::size_t n = scene_.bodies().size();
  const bool is_known = pair.a < n && pair.b < n && !std::isnan(answer.point_a.x) && !std::isnan(answer.normal.x);
  std::fill_n(out, joints_, is_known ? 0.0 : kNaN);
  if (!is_known || (answer.status == Status::kOverlap && answer.distance == 0)) return;
  // The distance is n . (p_b - p_a), and each point moves with its body. What carries both changes nothing.
  for (std::uint32_t a = mover_of_[pair.a], b = mover_of_[pair.b]; a != b;) {
    const bool next_is_a = b == kNone || (a != kNone && movers_[a].depth >= movers_[b].depth);
    if (next_is_a) {
      add(movers_[a], placement, pair.a, answer.point_a, -answer.normal, out);
      a = movers_[a].above;
    } else {
      add(movers_[b], placement, pair.b, answer.point_b, answer.normal, out);
      b = movers_[b].above;
    }
  }
}

// Adds how a point of a body moves along `normal`. \param point from the body's origin, world axes
void JointGradient::add(const Mover& mover, const Placement& placement, std::uint32_t body, const Vec3d& point,
                        const Vec3d& normal, double* out) const {
  const KinematicStep& step = *mover.step;
  const auto pose_of = [&](std::uint32_t link) -> const PlacedPose& {
    return placement[mover.robot->bodies[link]].pose;
  };
  const double scale = step.mimics ? step.multiplier : 1;
  if (step.kind != Kind::kTurning) {  // slides along axes of what carries it
    const Mat3d& R = pose_of(mover.robot->kinematics.carrier_of(step)).R_wb;
    for (std::size_t k = 0; k < (step.kind == Kind::kPlanar ? 2 : 1); ++k)
      if (mover.at[k] != kNone) out[mover.at[k]] += scale * dot(normal, R * step.along[k]);
  }
  const std::uint32_t at = mover.at[step.kind == Kind::kPlanar ? 2 : 0];
  if (step.kind == Kind::kSliding || at == kNone) return;
  const PlacedPose& link = pose_of(step.link);  // whose origin is on the axis
  const Vec3d arm = (placement[body].pose.t_w - link.t_w) + point;
  out[at] += scale * dot(normal, cross(link.R_wb * mover.axis, arm));
}

}  // namespace clearance
