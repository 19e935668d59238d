#include "engine/decision/slack_bounds.h"

#include <algorithm>
#include <cmath>

#include "engine/selection/body_poses.h"

namespace clearance {

namespace {

constexpr double kUp = 1 + 0x1p-40;  // more than the rounding of the sums below

bool slides(const KinematicStep& step) {
  return step.kind == KinematicStep::Kind::kSliding || step.kind == KinematicStep::Kind::kPlanar;
}

/// Greatest travel of each link at positions within most_travel().
std::vector<double> greatest_travels(const SceneRobot& robot) {
  std::vector<double> limits, low(robot.kinematics.links()), high(robot.kinematics.links());
  for (const RobotColumn& column : robot.model.columns) limits.push_back(most_travel(column));
  robot.kinematics.travels(limits, high);
  for (double& limit : limits) limit = -limit;
  robot.kinematics.travels(limits, low);
  for (std::size_t i = 0; i < low.size(); ++i) high[i] = std::max(high[i], low[i]);
  return high;
}

/// Bound on the distance of a link's origin from its root.
double farthest_link(const SceneRobot& robot, std::uint32_t link, double travel) {
  double slide_count = 0;
  for (const KinematicStep* step = robot.kinematics.step_of(link); step;
       step = robot.kinematics.step_of(robot.kinematics.carrier_of(*step)))
    slide_count += slides(*step) ? 2 : 0;  // a planar joint moves along two directions
  return (robot.kinematics.reach(link, 0) + slide_count * travel) * kUp;
}

}  // namespace

double most_travel(const RobotColumn& column) {
  const double most = std::max(std::abs(column.lower), std::abs(column.upper));
  return most < SlackBounds::kMostTravel ? most : SlackBounds::kMostTravel;
}

double SlackBounds::most_distance(const Pose& in_snapshot) {
  const double twice = 2 * norm(in_snapshot.translation);
  return twice > kMostTravel && twice < HUGE_VAL ? twice : kMostTravel;
}

SlackBounds::SlackBounds(const engine::Scene& scene, const Plan& plan)
    : plan_(plan), slot_(scene.bodies().size(), kNone) {
  const PoseSnapshot& snapshot = *plan.snapshot;
  std::vector<std::vector<double>> travels;
  for (const auto& robot : scene.robots()) travels.push_back(greatest_travels(*robot));
  for (const std::uint32_t b : plan.moved) {
    const Body& body = scene.bodies()[b];
    const std::uint32_t parent = snapshot.parent[b];
    const bool is_link = body.robot != kNone;
    const bool is_placed = std::find(plan.bodies.begin(), plan.bodies.end(), b) != plan.bodies.end();
    const double travel = is_link ? travels[body.robot][body.link] : 0;
    const double own = is_link     ? farthest_link(*scene.robots()[body.robot], body.link, travel)
                       : is_placed ? most_distance(snapshot.local[b]) * kUp
                                   : norm(snapshot.local[b].translation) * kUp;
    const bool is_carried = parent != kNone && slot_[parent] != kNone;
    slot_[b] = static_cast<std::uint32_t>(farthest_.size());
    farthest_.push_back((own + (is_carried ? farthest_[slot_[parent]] : 0)) * kUp);
    if (plan.uncertainties.empty()) continue;
    const double age_s = is_placed ? points_age_s(snapshot, b, plan.begun_ns) : pose_age_s(snapshot, b, plan.begun_ns);
    double from_world = farthest_.back();
    for (std::uint32_t on = parent; on != kNone; on = snapshot.parent[on])
      if (slot_[on] == kNone) {
        from_world += norm(snapshot.placed[on].pose.t_w) * kUp;
        break;
      }
    PlacedLink link = plan.uncertainties[b].link;
    link.travel = travel;
    uncertainties_.push_back(uncertainty_of(body, {{own, 0, 0}}, {from_world * kUp, 0, 0}, age_s,
                                            parent == kNone ? nullptr : &uncertainty(parent), true, link));
  }
}

const PoseUncertainty& SlackBounds::uncertainty(std::uint32_t body) const {
  return slot_[body] == kNone ? plan_.uncertainties[body] : uncertainties_[slot_[body]];
}

Slack SlackBounds::of(BodyPair pair) const {
  return plan_.uncertainties.empty() ? Slack() : pair_slack(uncertainty(pair.a), uncertainty(pair.b));
}

}  // namespace clearance
