#include "engine/uncertainty/pose_uncertainty.h"

#include <algorithm>
#include <cmath>

namespace clearance {

namespace {

// Upper bound on how far a rotation by at most `angle` about the origin moves a point, per metre from the origin.
double chord(double angle) {
  return angle >= M_PI ? 2 : detail::up(2 * std::sin(0.5 * angle));
}

}  // namespace

UncertaintySource uncertainty_source(const Body& body) {
  return {body.max_speed,
          body.uncertainty.position,
          chord(body.uncertainty.angle),
          detail::up(body.reach + body.model_inner),
          body.model_inner,
          body.model_error};
}

FrameUncertainty joints_of(const PlacedLink& link) {
  if (!link.errors) return {};
  return {link.errors->shift(link.link, link.travel), link.errors->turn(link.link)};
}

PoseUncertainty uncertainty_of(const Body& body, const Pose& local, const Vec3d& t_w, double age_s,
                               const PoseUncertainty* parent, bool composed, const PlacedLink& link) {
  return {uncertainty_below(uncertainty_source(body), local.translation, t_w, age_s, parent, composed, joints_of(link)),
          link};
}

namespace {

// Travel of each robot's links at the current joint positions.
std::vector<std::vector<double>> travels_of(const engine::Scene& scene, const PoseSnapshot& snapshot) {
  std::vector<std::vector<double>> travels;
  for (const auto& robot : scene.robots())
    robot->kinematics.travels(
        std::span(snapshot.joints.position).subspan(robot->first_joint, robot->model.columns.size()),
        travels.emplace_back(robot->kinematics.links()));
  return travels;
}

}  // namespace

double points_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns) {
  const ReceivedPoints* const points = snapshot.points_of(body);
  return points ? 1e-9 * static_cast<double>(std::max<std::int64_t>(now_ns - points->receipt_ns, 0)) : 0;
}

double pose_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns) {
  const std::int64_t receipt = snapshot.receipt_ns[body];
  const std::int64_t age_ns = now_ns - (receipt ? receipt : snapshot.loaded_ns);
  return std::max(1e-9 * static_cast<double>(std::max<std::int64_t>(age_ns, 0)), points_age_s(snapshot, body, now_ns));
}

std::vector<PoseUncertainty> uncertainties_of(const engine::Scene& scene, const PoseSnapshot& snapshot,
                                              std::int64_t now_ns) {
  if (!scene.has_uncertainties() && !snapshot.has_followers) return {};
  std::vector<PoseUncertainty> uncertainties(scene.bodies().size());
  const std::vector<std::vector<double>> travels = travels_of(scene, snapshot);
  for (const std::uint32_t b : *snapshot.order) {
    const Body& body = scene.bodies()[b];
    PlacedLink& link = uncertainties[b].link;  // also for a link whose pose only a query gives
    if (body.robot != kNone) link = {&scene.robots()[body.robot]->errors, body.link, travels[body.robot][body.link]};
    if (snapshot.placed[b].status != Status::kOk) continue;
    const double age_s = body.is_static ? 0 : pose_age_s(snapshot, b, now_ns);
    const std::uint32_t on = snapshot.parent[b];
    uncertainties[b] = uncertainty_of(body, snapshot.local[b], snapshot.placed[b].pose.t_w, age_s,
                                      on == kNone ? nullptr : &uncertainties[on],
                                      on != kNone && is_composed(snapshot.placed[on]), link);
  }
  return uncertainties;
}

}  // namespace clearance
