// Converts a robot's joints to kinematic steps, with constants computed to about 95 bits and rounded once.
#include <cmath>

#include "engine/base/fp_environment.h"
#include "engine/robot/exact_frame.h"
#include "engine/robot/kinematics.h"

namespace clearance {

namespace {

using Exact = DoubleDouble;
using ExactVec = Vec3<Exact>;

ExactVec unit(const Vec3d& axis) {
  const ExactVec a = cast<Exact>(rescaled(axis));
  const Exact length = sqrt(squared_norm(a));
  return {a.x / length, a.y / length, a.z / length};
}

}  // namespace

class KinematicsBuilder {
 public:
  KinematicsBuilder(const RobotModel& robot, Kinematics* out) : robot_(robot), out_(*out) {}

  void build() {
    out_.columns_ = robot_.columns.size();
    out_.nodes_.resize(robot_.links.size());
    on_.resize(robot_.links.size());
    add_root(robot_.base);
    for (const RobotJoint& joint : robot_.joints)
      if (joint.kind == JointKind::kFloating) add_root(joint.child);
    for (const RobotJoint& joint : robot_.joints)
      if (joint.kind != JointKind::kFloating) add_step(joint);
  }

 private:
  // The frame that carries a link, and the link's pose in it.
  struct On {
    std::uint32_t frame = 0;
    ExactFrame X;
  };

  void add_root(std::uint32_t link) {
    const auto frame = static_cast<std::uint32_t>(out_.roots_.size());
    out_.roots_.push_back(link);
    out_.nodes_[link] = {frame, 0, 0};
    on_[link] = {frame, {}};
  }

  void add_step(const RobotJoint& joint) {
    const On& parent = on_[joint.parent];
    const ExactFrame X = parent.X * exact_frame(joint.X_pj);
    KinematicStep step;
    step.from = parent.frame;
    step.link = joint.child;
    double still = 0, turning = 0, at = 0, along = 0;
    step.still = rounded(X.q, &still);
    step.at = rounded(X.t, &at);
    if (joint.kind != JointKind::kFixed) add_motion(joint, X, &step, &turning, &along);
    const auto frame = static_cast<std::uint32_t>(out_.roots_.size() + out_.steps_.size());
    out_.steps_.push_back(step);
    out_.slides_ |= step.kind == KinematicStep::Kind::kSliding || step.kind == KinematicStep::Kind::kPlanar;
    out_.step_errors_.push_back(out_.error_of(step, std::hypot(still, turning), at, along));
    // A link on a fixed joint has its own frame, but its children are attached to the frame that carries it.
    on_[joint.child] = joint.kind == JointKind::kFixed ? On{parent.frame, X} : On{frame, {}};
    const Kinematics::StepError& error = out_.step_errors_.back();
    const Kinematics::Node& carrier = out_.nodes_[out_.carrier_of(step)];
    out_.nodes_[joint.child] = {frame, carrier.length + error.length, carrier.length_travel + error.length_travel};
  }

  void add_motion(const RobotJoint& joint, const ExactFrame& X, KinematicStep* step, double* inexact_turn,
                  double* inexact_along) const {
    using Kind = KinematicStep::Kind;
    step->column = joint.column;
    if (joint.mimic) {
      step->mimics = true;
      step->multiplier = joint.mimic->multiplier;
      step->offset = joint.mimic->offset;
      step->column = robot_.joints[joint.mimic->joint].column;
    }
    const ExactVec axis = unit(joint.axis);
    if (joint.kind == JointKind::kPrismatic) {
      step->kind = Kind::kSliding;
      step->along[0] = rounded(turned(X.q, axis), inexact_along);
      return;
    }
    step->kind = Kind::kTurning;
    step->turning = rounded(product(X.q, Quaternion<Exact>{0, axis.x, axis.y, axis.z}), inexact_turn);
    if (joint.kind != JointKind::kPlanar) return;
    step->kind = Kind::kPlanar;
    double x = 0, y = 0;
    step->along[0] = rounded(turned(X.q, ExactVec{1, 0, 0}), &x);
    step->along[1] = rounded(turned(X.q, ExactVec{0, 1, 0}), &y);
    *inexact_along = std::hypot(x, y);
  }

  const RobotModel& robot_;
  Kinematics& out_;
  std::vector<On> on_;  // by link
};

Kinematics::Kinematics(const RobotModel& robot) {
  const FpEnvironment environment;
  KinematicsBuilder(robot, this).build();
}

}  // namespace clearance
