#include "engine/python/update_binding.h"

#include <nanobind/stl/vector.h>

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "engine/python/scene_bindings.h"

namespace clearance::python {

nb::tuple PyUpdates::set_poses(const BodiesArray& ids, const PoseRows& poses, std::int64_t stamp_ns,
                               std::int64_t sequence, const std::optional<TwistRows>& velocities,
                               std::uint64_t revision) const {
  if (ids.shape(0) != poses.shape(0)) throw nb::value_error("poses: expected one pose for each body");
  std::vector<BodyPose> batch(ids.shape(0));
  const std::span<const BodyTwist> twists = velocities_of(velocities, batch.size());
  for (std::size_t i = 0; i < batch.size(); ++i) {
    batch[i].body = ids.data()[i];
    batch[i].pose = pose_from(poses.data() + 7 * i);
    if (!twists.empty()) batch[i].velocity = twists[i];
  }
  return update([&](engine::Engine& engine) {
    check_ids(engine, revision, {ids.data(), ids.shape(0)}, true);
    return engine.set_poses(batch, stamp_ns, sequence);
  });
}

nb::tuple PyUpdates::set_joints(const BodiesArray& ids, const PositionRow& positions, std::int64_t stamp_ns,
                                std::int64_t sequence, const std::optional<PositionRow>& velocities) const {
  if (ids.shape(0) != positions.shape(0)) throw nb::value_error("positions: expected one for each joint");
  std::vector<JointPosition> batch(ids.shape(0));
  const std::span<const double> speeds = velocities_of(velocities, batch.size());
  for (std::size_t i = 0; i < batch.size(); ++i)
    batch[i] = {ids.data()[i], positions.data()[i], speeds.empty() ? kUnknownSpeed : speeds[i]};
  return update([&](engine::Engine& engine) { return engine.set_joints(batch, stamp_ns, sequence); });
}

nb::tuple PyUpdates::set_points(std::uint32_t body, const CloudRows& xyz, const std::optional<double>& radius,
                                std::int64_t stamp_ns, std::int64_t sequence, std::uint64_t revision) const {
  const std::span<const CloudPoint> points = rows_of<CloudPoint>(xyz);
  return update([&](engine::Engine& engine) {
    check_ids(engine, revision, {&body, 1});
    return engine.set_points(body, points, radius, stamp_ns, sequence);
  });
}

nb::tuple PyUpdates::joints() const {
  const std::shared_ptr<engine::Engine> engine = use();
  const engine::Scene& scene = engine->scene();
  nb::list joints, groups;
  for (std::uint32_t j = 0; j < scene.joints().size(); ++j) {
    const SceneJoint& joint = scene.joints()[j];
    const JointState s = engine->joint_state(j);
    joints.append(nb::make_tuple(joint.name, joint.lower, joint.upper, s.position, static_cast<int>(s.status),
                                 s.beyond_limits, s.stamp_ns, s.receipt_ns ? monotonic_ns() - s.receipt_ns : -1));
  }
  for (const JointGroup& group : scene.joint_groups()) groups.append(nb::make_tuple(group.name, group.joints));
  return nb::make_tuple(joints, groups);
}

nb::tuple PyUpdates::attach(std::uint32_t child, std::uint32_t parent, const std::optional<PoseRows>& pose,
                            const BodiesArray& allow, std::uint64_t revision) const {
  Pose X_pc;
  if (pose) {
    if (pose->shape(0) != 1) throw nb::value_error("pose: expected one pose");
    X_pc = pose_from(pose->data());
  }
  const std::span<const std::uint32_t> allowed(allow.data(), allow.shape(0));
  return update([&](engine::Engine& engine) {
    check_ids(engine, revision, {&child, 1});
    if (parent != kNone) check_ids(engine, revision, {&parent, 1});
    check_ids(engine, revision, allowed);
    return engine.attach(child, parent, pose ? &X_pc : nullptr, allowed);
  });
}

nb::tuple PyUpdates::allow(std::uint32_t a, std::uint32_t b, bool allow, std::uint64_t revision) const {
  return update([&](engine::Engine& engine) {
    check_ids(engine, revision, std::array{a, b});
    return engine.allow(a, b, allow);
  });
}

nb::list PyUpdates::body_states() const {
  nb::list states;
  const std::shared_ptr<engine::Engine> engine = use();
  const std::size_t count = engine->scene().bodies().size();
  for (std::size_t i = 0; i < count; ++i) {
    const BodyState s = engine->body_state(static_cast<std::uint32_t>(i));
    states.append(nb::make_tuple(tuple_of(s.X_wb), static_cast<int>(s.status), s.parent, s.stamp_ns,
                                 s.receipt_ns ? monotonic_ns() - s.receipt_ns : -1));
  }
  return states;
}

}  // namespace clearance::python
