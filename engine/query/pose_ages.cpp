#include "engine/query/pose_ages.h"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace clearance {

namespace {

// Finds stale links of a robot that the query moves. They depend on the query's joints, but also on the pose of the
// robot's base and on its other joints.
void find_stale_links(const engine::Scene& scene, const Plan& plan, const LinkMotion& motion,
                      std::int64_t oldest_allowed, std::vector<std::uint8_t>& stale) {
  const PoseSnapshot& snapshot = *plan.snapshot;
  const SceneRobot& robot = motion.robot();
  std::vector<std::uint8_t> old(robot.model.columns.size());
  for (std::size_t c = 0; c < old.size(); ++c) {
    const std::int64_t receipt = snapshot.joints.receipt_ns[robot.first_joint + c];
    old[c] = receipt != 0 && receipt < oldest_allowed;
  }
  for (const LinkMotion::Moving& m : motion.moving()) old[m.column] = 0;
  const std::vector<std::uint8_t> is_old = bits_along_links(robot, old);
  for (const std::uint32_t link : motion.links())
    stale[robot.bodies[link]] = is_old[link] || stale[snapshot.parent[robot.bodies[link]]];
  std::vector<std::uint8_t> on_old(stale.size(), 0);
  for (const std::uint32_t b : plan.moved) {  // bodies that follow the links
    const std::uint32_t on = snapshot.parent[b];
    on_old[b] = scene.bodies()[b].robot != kNone ? stale[b] : on != kNone && on_old[on];
    stale[b] |= on_old[b];
  }
}

// By body, 1 if stale.
std::vector<std::uint8_t> find_stale(const engine::Scene& scene, const Plan& plan, std::int64_t oldest_allowed) {
  const PoseSnapshot& snapshot = *plan.snapshot;
  std::vector<std::uint8_t> stale(scene.bodies().size());
  for (std::uint32_t b = 0; b < stale.size(); ++b) {
    const std::int64_t receipt = snapshot.receipt_of_chain(b);
    stale[b] = !scene.bodies()[b].is_static && (receipt == 0 || receipt < oldest_allowed);
  }
  if (plan.query.configuration_count == 0) return stale;
  for (const std::uint32_t b : plan.moved) {  // the query gives their poses, but not the points of clouds
    const ReceivedPoints* const points = snapshot.points_of(b);
    stale[b] = points && points->receipt_ns < oldest_allowed;
  }
  for (const LinkMotion& motion : plan.motions) find_stale_links(scene, plan, motion, oldest_allowed, stale);
  return stale;
}

}  // namespace

std::shared_ptr<const PoseSnapshot> with_stale_poses(const engine::Scene& scene, const Plan& plan) {
  if (plan.query.max_pose_age_ns == 0) return plan.snapshot;
  const std::vector<std::uint8_t> stale = find_stale(scene, plan, plan.begun_ns - plan.query.max_pose_age_ns);
  if (std::find(stale.begin(), stale.end(), 1) == stale.end()) return plan.snapshot;
  auto own = std::make_shared<PoseSnapshot>(*plan.snapshot);
  for (std::uint32_t b = 0; b < stale.size(); ++b)
    if (stale[b] && own->placed[b].status == Status::kOk) own->placed[b].status = Status::kStalePose;
  if (plan.query.configuration_count > 0)
    for (const std::uint32_t b : plan.moved)  // also bodies that only the query places
      if (stale[b]) own->placed[b].status = Status::kStalePose;
  return own;
}

}  // namespace clearance
