#include "client/python/bindings/client_scene.h"

#include <nanobind/stl/vector.h>

#include <algorithm>
#include <span>
#include <utility>

#include "client/client.h"

namespace clearance::python {
namespace {

/// Returns scene revision, number of bodies, id of the new one, seconds.
nb::tuple changed(const SceneChanged& r) {
  return nb::make_tuple(r.scene_revision, r.body_count, r.body, r.seconds);
}
nb::tuple done(const UpdateResult& r) {
  return nb::make_tuple(r.revision, r.scene_revision, r.applied, r.bad, r.unknown, r.fixed);
}

}  // namespace

nb::tuple PyClientScene::set_poses(const BodiesArray& ids, const PoseRows& poses, std::int64_t stamp_ns,
                                   std::int64_t sequence, const std::optional<TwistRows>& velocities) const {
  if (ids.shape(0) != poses.shape(0)) throw nb::value_error("poses: expected one pose for each body");
  std::vector<std::pair<std::uint32_t, Pose7>> batch(ids.shape(0));
  for (std::size_t i = 0; i < batch.size(); ++i) {
    batch[i].first = ids.data()[i];
    std::copy_n(poses.data() + 7 * i, 7, batch[i].second.begin());
  }
  return done(use().with([&](Client& client) {
    return client.set_poses(batch, stamp_ns, sequence, velocities_of(velocities, batch.size()));
  }));
}

nb::tuple PyClientScene::set_joints(const BodiesArray& ids, const PositionRow& positions, std::int64_t stamp_ns,
                                    std::int64_t sequence, const std::optional<PositionRow>& velocities) const {
  if (ids.shape(0) != positions.shape(0)) throw nb::value_error("positions: expected one for each joint");
  std::vector<std::pair<std::uint32_t, double>> batch(ids.shape(0));
  for (std::size_t i = 0; i < batch.size(); ++i) batch[i] = {ids.data()[i], positions.data()[i]};
  return done(use().with([&](Client& client) {
    return client.set_joints(batch, stamp_ns, sequence, velocities_of(velocities, batch.size()));
  }));
}

nb::tuple PyClientScene::set_points(std::uint32_t body, const CloudRows& xyz, const std::optional<double>& radius,
                                    std::int64_t stamp_ns, std::int64_t sequence) const {
  const std::span<const std::array<float, 3>> points(reinterpret_cast<const std::array<float, 3>*>(xyz.data()),
                                                     xyz.shape(0));
  return done(use().with([&](Client& client) { return client.set_points(body, points, radius, stamp_ns, sequence); }));
}

nb::tuple PyClientScene::joints() const {
  const JointsInfo info = use().with([](Client& client) { return client.joint_states(); });
  nb::list joints, groups;
  for (const JointInfo& j : info.joints)
    joints.append(nb::make_tuple(j.name, j.lower, j.upper, j.position, static_cast<int>(j.status), j.beyond_limits,
                                 j.stamp_ns, j.age_ns));
  for (const JointGroupInfo& g : info.groups) groups.append(nb::make_tuple(g.name, g.joints));
  return nb::make_tuple(joints, groups);
}

nb::tuple PyClientScene::attach(std::uint32_t child, std::uint32_t parent, const std::optional<PoseRows>& pose,
                                const BodiesArray& allow) const {
  Pose7 X_pc{};
  if (pose) {
    if (pose->shape(0) != 1) throw nb::value_error("pose: expected one pose");
    std::copy_n(pose->data(), 7, X_pc.begin());
  }
  const std::span<const std::uint32_t> allowed(allow.data(), allow.shape(0));
  return done(
      use().with([&](Client& client) { return client.attach(child, parent, pose ? &X_pc : nullptr, allowed); }));
}

nb::tuple PyClientScene::allow(std::uint32_t a, std::uint32_t b, bool allow) const {
  return done(use().with([&](Client& client) { return allow ? client.allow(a, b) : client.forbid(a, b); }));
}

nb::tuple PyClientScene::reload(double timeout_s) const {
  return changed(use().with([&](Client& client) { return client.reload(duration_of(timeout_s)); }));
}

nb::tuple PyClientScene::add_body(const std::string& name, const std::string& shape, const VertexRows& numbers,
                                  double radius, std::uint32_t parent, bool is_static,
                                  const std::optional<PoseRows>& pose, const std::array<double, 4>& uncertainties,
                                  const TriangleRows& triangles, int mesh_as, const CloudRows& cloud,
                                  bool replaces) const {
  const auto* rows = reinterpret_cast<const std::array<double, 3>*>(numbers.data());
  NewBody body;
  body.name = name;
  if (shape == "vertices" || shape == "mesh") body.vertices = {rows, numbers.shape(0)};
  body.triangles = {reinterpret_cast<const std::array<std::uint32_t, 3>*>(triangles.data()), triangles.shape(0)};
  body.mesh_as = static_cast<MeshAs>(mesh_as);
  if (shape == "box") body.box = rows[0];
  if (shape == "sphere") body.sphere = rows[0][0];
  if (shape == "capsule") body.capsule = {rows[0][0], rows[0][1]};
  if (shape == "cylinder") body.cylinder = {rows[0][0], rows[0][1]};
  if (shape == "cone") body.cone = {rows[0][0], rows[0][1]};
  if (shape == "ellipsoid") body.ellipsoid = rows[0];
  body.half_space = shape == "half_space";
  if (shape == "points") {
    body.points.emplace(reinterpret_cast<const std::array<float, 3>*>(cloud.data()), cloud.shape(0));
    body.voxel = rows[0][0];
  }
  body.radius = radius;
  body.parent = parent;
  body.is_static = is_static;
  body.uncertainty_position = uncertainties[0];
  body.uncertainty_angle = uncertainties[1];
  body.padding = uncertainties[2];
  body.max_speed = uncertainties[3];
  if (pose) std::copy_n(pose->data(), 7, body.pose.emplace().begin());
  return changed(use().with([&](Client& client) { return replaces ? client.replace(body) : client.add_body(body); }));
}

nb::tuple PyClientScene::remove_body(const std::string& name) const {
  return changed(use().with([&](Client& client) { return client.remove_body(name); }));
}

nb::tuple PyClientScene::scene(bool refresh) const {
  const SceneInfo info = use().with([&](Client& client) {
    if (refresh) client.refresh();
    return client.scene();
  });
  nb::list bodies, groups;
  for (const BodyInfo& b : info.bodies) {
    bodies.append(nb::make_tuple(b.name, b.parent, b.is_static, b.piece_count, b.vertex_count, b.model_error, b.extent,
                                 b.hull_excess, b.empty_share, b.triangle_count, b.is_solid, b.is_cloud));
  }
  for (const GroupInfo& g : info.groups) groups.append(nb::make_tuple(g.name, g.bodies));
  return nb::make_tuple(info.revision, info.backend, info.pair_count, bodies, groups);
}

nb::list PyClientScene::body_states() const {
  nb::list list;
  for (const BodyStateInfo& s : use().with([](Client& client) { return client.body_states(); })) {
    const Pose7& X = s.pose;
    list.append(nb::make_tuple(nb::make_tuple(X[0], X[1], X[2], X[3], X[4], X[5], X[6]), static_cast<int>(s.status),
                               s.parent, s.stamp_ns, s.age_ns));
  }
  return list;
}

}  // namespace clearance::python
