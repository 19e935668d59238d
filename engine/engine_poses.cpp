// The functions of Engine that set and return poses, joints, points and attachments.
#include <algorithm>
#include <stdexcept>
#include <vector>

#include "engine/base/fp_environment.h"
#include "engine/engine_impl.h"

namespace clearance::engine {

PoseUpdateResult Engine::set_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                                   std::uint64_t publisher) {
  const FpEnvironment environment;
  const PoseUpdateResult result = impl_->poses.set(poses, stamp_ns, sequence, publisher);
  count_copied(result.copied_bytes);
  impl_->pose_updates.fetch_add(result.applied, std::memory_order_relaxed);
  impl_->bad_poses.fetch_add(result.bad, std::memory_order_relaxed);
  return result;
}

PoseUpdateResult Engine::set_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns,
                                    std::int64_t sequence, std::uint64_t publisher) {
  const FpEnvironment environment;
  const PoseUpdateResult result = impl_->poses.set_joints(positions, stamp_ns, sequence, publisher);
  impl_->joint_updates.fetch_add(result.applied, std::memory_order_relaxed);
  impl_->bad_joints.fetch_add(result.bad, std::memory_order_relaxed);
  return result;
}

PoseUpdateResult Engine::set_points(std::uint32_t body, std::span<const CloudPoint> points,
                                    std::optional<double> radius, std::int64_t stamp_ns, std::int64_t sequence,
                                    std::uint64_t publisher) {
  const FpEnvironment environment;
  const PoseUpdateResult result = impl_->poses.set_points(body, points, radius, stamp_ns, sequence, publisher);
  count_copied(result.copied_bytes);
  impl_->point_updates.fetch_add(1, std::memory_order_relaxed);
  impl_->request_cover_of_points(body);
  return result;
}

JointState Engine::joint_state(std::uint32_t joint) const {
  const auto snapshot = impl_->poses.snapshot();
  if (joint >= impl_->scene.joints().size()) throw std::out_of_range("unknown joint " + std::to_string(joint));
  const PoseSnapshot::Joints& joints = snapshot->joints;
  const SceneJoint& of = impl_->scene.joints()[joint];
  const std::uint8_t fact =
      position_fact(impl_->scene.robots()[of.robot]->model.columns[of.column], joints.position[joint]);
  const Status status = !joints.given[joint] ? Status::kNoPose : fact & kLinkBad ? Status::kBadPose : Status::kOk;
  return {joints.position[joint], status, joints.given[joint] && (fact & kLinkBeyondLimits), joints.stamp_ns[joint],
          joints.receipt_ns[joint]};
}

void Engine::check_stamp(std::int64_t stamp_ns) const {
  impl_->poses.check_stamp(stamp_ns);
}

PoseUpdateResult Engine::attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc,
                                std::span<const std::uint32_t> allow) {
  const FpEnvironment environment;
  return impl_->poses.attach(child, parent, X_pc, allow);
}

PoseUpdateResult Engine::allow(std::uint32_t a, std::uint32_t b, bool allow) {
  const FpEnvironment environment;
  return impl_->poses.allow(a, b, allow);
}

bool Engine::ids_valid_since(std::uint64_t scene_revision, std::span<const std::uint32_t> selectors,
                             bool with_parents) const {
  const auto snapshot = impl_->poses.snapshot();
  return scene_revision == snapshot->scene_revision ||
         snapshot->history->ids_valid_since(scene_revision, snapshot->scene_changes, selectors, with_parents);
}

bool Engine::names_valid_since(std::uint64_t scene_revision, std::span<const std::uint32_t> selectors,
                               bool with_parents) const {
  const auto snapshot = impl_->poses.snapshot();
  return scene_revision == snapshot->scene_revision ||
         snapshot->history->names_valid_since(scene_revision, selectors, with_parents);
}

bool Engine::joints_still_mean(std::uint64_t scene_revision, std::span<const std::uint32_t> joints) const {
  if (scene_revision == impl_->poses.snapshot()->scene_revision) return true;
  std::vector<std::uint32_t> links;  // one link of a robot represents all of its joints
  for (const std::uint32_t joint : joints) {
    if (joint >= impl_->scene.joints().size()) return false;
    const SceneRobot& robot = *impl_->scene.robots()[impl_->scene.joints()[joint].robot];
    links.push_back(robot.bodies[robot.model.base]);
  }
  return ids_valid_since(scene_revision, links, false);
}

void Engine::take_poses(const Engine& old, std::string_view reshaped) {
  const FpEnvironment environment;
  impl_->poses.take_over(old.impl_->poses, reshaped);
  const auto snapshot = impl_->poses.snapshot();
  for (std::uint32_t body = 0; snapshot->points && body < impl_->scene.bodies().size(); ++body)
    impl_->request_cover_of_points(body);
}

void Engine::stop_updates(bool stop) {
  impl_->poses.stop_updates(stop);
}

BodyState Engine::body_state(std::uint32_t body) const {
  const auto snapshot = impl_->poses.snapshot();
  if (body >= snapshot->placed.size()) throw std::out_of_range("unknown body " + std::to_string(body));
  const BodyPlacement& p = snapshot->placed[body];
  std::int64_t receipt = snapshot->receipt_ns[body];
  if (const ReceivedPoints* points = snapshot->points_of(body); points && points->receipt_ns)
    receipt = receipt ? std::min(receipt, points->receipt_ns) : points->receipt_ns;
  return {p.pose.X_wb, p.status, snapshot->parent[body], snapshot->stamp_ns[body], receipt};
}

std::int64_t Engine::oldest_stamp(std::uint32_t bodies) const {
  const auto snapshot = impl_->poses.snapshot();
  const std::vector<Group>& groups = impl_->scene.groups();
  const bool is_group = bodies != kEveryBody && (bodies & kGroupBit);
  if (is_group && (bodies & ~kGroupBit) >= groups.size())
    throw QueryError(QueryErrorCode::kBadQuery, "wait_for: unknown group " + std::to_string(bodies & ~kGroupBit));
  if (!is_group && bodies != kEveryBody && bodies >= snapshot->stamp_ns.size())
    throw QueryError(QueryErrorCode::kBadQuery, "wait_for: unknown body " + std::to_string(bodies));
  units_of_this_thread += (is_group ? groups[bodies & ~kGroupBit].bodies.size() : snapshot->stamp_ns.size()) / 64;
  std::int64_t oldest = 0;
  const auto take = [&](std::int64_t stamp) {
    if (stamp != 0 && (oldest == 0 || stamp < oldest)) oldest = stamp;
  };
  if (is_group)
    for (const std::uint32_t b : groups[bodies & ~kGroupBit].bodies) take(snapshot->stamp_ns[b]);
  else if (bodies == kEveryBody)
    for (const std::int64_t stamp : snapshot->stamp_ns) take(stamp);
  else
    take(snapshot->stamp_ns[bodies]);
  return oldest;
}

}  // namespace clearance::engine
