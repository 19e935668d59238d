// The part of the pose store that receives joint positions and derives the poses of links.
#include <algorithm>
#include <tuple>
#include <utility>

#include "engine/scene/link_motion.h"
#include "engine/state/pose_store.h"

namespace clearance {

namespace {

// When a joint was set; all zero if never.
struct Marks {
  std::int64_t receipt_ns = 0, stamp_ns = 0, sequence = 0;
};

// Combines two joints in a link's chain: the earlier receipt and the older stamp. Joints without one are ignored.
Marks older(Marks a, Marks b) {
  const bool by_receipt = a.receipt_ns == 0 || (b.receipt_ns != 0 && b.receipt_ns < a.receipt_ns);
  const bool by_stamp = a.stamp_ns == 0 || (b.stamp_ns != 0 && b.stamp_ns < a.stamp_ns);
  return {by_receipt ? b.receipt_ns : a.receipt_ns, by_stamp ? b.stamp_ns : a.stamp_ns,
          by_stamp ? b.sequence : a.sequence};
}

}  // namespace

std::vector<std::uint32_t> PoseSnapshot::move_links(const SceneRobot& robot, std::span<const std::uint32_t> changed) {
  const std::size_t count = robot.model.columns.size(), first = robot.first_joint;
  const LinkMotion motion(robot, std::span(joints.position).subspan(first, count),
                          std::span(joints.given).subspan(first, count));
  const std::size_t links = motion.links().size();
  std::vector<Pose> poses(links);
  std::vector<std::uint8_t> facts(links), is_changed(count, changed.empty());
  LinkMotion::LinkScratch scratch;
  motion.make({}, 1, poses.data(), facts.data(), links, scratch);
  for (const std::uint32_t joint : changed) is_changed[joint - first] = 1;
  std::vector<Marks> of_columns;
  for (std::size_t j = first; j < first + count; ++j)
    of_columns.push_back({joints.receipt_ns[j], joints.stamp_ns[j], joints.sequence[j]});
  const std::vector<Marks> marks = along_links(robot, std::span<const Marks>(of_columns), older);
  const std::vector<std::uint8_t> is_moved = bits_along_links(robot, is_changed);
  std::vector<std::uint32_t> moved;
  for (std::size_t i = 0; i < links; ++i) {
    const std::uint32_t link = motion.links()[i], body = robot.bodies[link];
    if (!changed.empty() && !is_moved[link]) continue;
    local[body] = poses[i];
    given[body] = !(facts[i] & kLinkUnplaced);
    beyond_limits[body] = (facts[i] & kLinkBeyondLimits) != 0;
    std::tie(receipt_ns[body], stamp_ns[body], sequence[body]) =
        std::tie(marks[link].receipt_ns, marks[link].stamp_ns, marks[link].sequence);
    moved.push_back(body);
  }
  return moved;
}

namespace {

// Moves the links of joints, which are in order. Returns the moved bodies.
std::vector<std::uint32_t> move_links_of(PoseSnapshot& next, const engine::Scene& scene,
                                         const std::vector<std::uint32_t>& changed) {
  const std::vector<SceneJoint>& joints = scene.joints();
  std::vector<std::uint32_t> moved;
  for (auto begin = changed.begin(); begin != changed.end();) {  // joints of one robot are consecutive
    const std::uint32_t robot = joints[*begin].robot;
    const auto end = std::find_if(begin, changed.end(), [&](std::uint32_t j) { return joints[j].robot != robot; });
    const auto links = next.move_links(*scene.robots()[robot], {begin, end});
    moved.insert(moved.end(), links.begin(), links.end());
    begin = end;
  }
  return moved;
}

}  // namespace

PoseUpdateResult PoseStore::set_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns,
                                       std::int64_t sequence, std::uint64_t publisher) {
  check_stamp(stamp_ns);
  const auto lock = lock_for_update();
  const std::vector<SceneJoint>& joints = scene_.joints();
  PoseUpdateResult result;
  std::vector<std::uint32_t> changed;
  for (const JointPosition& p : positions) {
    if (p.joint >= joints.size()) {
      ++result.unknown;
      continue;
    }
    check_not_late(joint_marks_, p.joint, joints[p.joint].name, stamp_ns, publisher);
    changed.push_back(p.joint);
  }
  std::sort(changed.begin(), changed.end());
  if (const auto twice = std::adjacent_find(changed.begin(), changed.end()); twice != changed.end())
    throw engine::QueryError(QueryErrorCode::kBadQuery, "joints: '" + joints[*twice].name + "' is named twice");
  const std::shared_ptr<PoseSnapshot> next = copy();
  const std::int64_t now = monotonic_ns();
  for (const JointPosition& p : positions) {
    if (p.joint >= joints.size()) continue;
    const SceneJoint& joint = joints[p.joint];
    next->joints.position[p.joint] = p.position;
    next->joints.given[p.joint] = 1;
    next->joints.velocity[p.joint] = p.velocity;
    next->joints.stamp_ns[p.joint] = stamp_ns;
    next->joints.receipt_ns[p.joint] = now;
    next->joints.sequence[p.joint] = sequence;
    joint_marks_.note(p.joint, publisher, stamp_ns);
    const RobotColumn& column = scene_.robots()[joint.robot]->model.columns[joint.column];
    ++(position_fact(column, p.position) & kLinkBad ? result.bad : result.applied);
  }
  if (!changed.empty()) publish_moved(next, move_links_of(*next, scene_, changed));
  result.revision = next->revision;
  result.copied_bytes = std::exchange(copied_bytes_, 0);
  return result;
}

// Takes over received positions of joints with the same names.
void PoseStore::take_over_joints(const PoseStore& old_store, PoseSnapshot& next) {
  const PoseSnapshot::Joints& old = old_store.current_->joints;
  const std::vector<SceneJoint>& old_joints = old_store.scene_.joints();
  for (std::uint32_t was = 0; was < old_joints.size(); ++was) {
    const std::uint32_t now = scene_.find_joint(old_joints[was].name);
    if (now == kNone) continue;
    joint_marks_.take_over(now, old_store.joint_marks_, was);
    if (old.receipt_ns[was] == 0) continue;
    next.joints.position[now] = old.position[was];
    next.joints.given[now] = old.given[was];
    next.joints.velocity[now] = old.velocity[was];
    next.joints.stamp_ns[now] = old.stamp_ns[was];
    next.joints.receipt_ns[now] = old.receipt_ns[was];
    next.joints.sequence[now] = old.sequence[was];
  }
  for (const auto& robot : scene_.robots()) next.move_links(*robot, {});
}

}  // namespace clearance
