#include "engine/api/conversions.h"

#include <stdexcept>
#include <string>

#include "engine/bvh/surface.h"
#include "engine/scene/body_ball.h"

namespace clearance {

static_assert(sizeof(Pose7) == sizeof(Pose) && sizeof(IdPair) == sizeof(BodyPair));

QueryView view_without_inputs(const Query& query) {
  for_each_query_option([&query](const QueryOption& option, auto member) {
    if constexpr (!requires(QueryView& view) { member(view); })
      if (member(query) != member(kDefaultOptions))
        throw std::invalid_argument(std::string("query: ") + option.name + " is for a daemon's client");
  });
  QueryView view;
  copy_options(query, view);
  view.all_pairs = query.pairs.empty() && query.all_pairs;
  view.pairs = {reinterpret_cast<const BodyPair*>(query.pairs.data()), query.pairs.size()};
  view.bodies = query.bodies;
  view.joints = query.joints;
  view.margins = query.margins;
  view.pair_margins = query.pair_margins;
  view.weights = query.weights;
  view.speed_errors = query.speed_errors;
  return view;
}

void take_inputs(const Query& query, QueryView& view) {
  view.configurations = {reinterpret_cast<const Pose*>(query.configurations.data()), query.configurations.size()};
  view.positions = query.positions;
  view.growths = query.growths;
  view.velocities = query.velocities;
  view.twists = query.twists;
  view.configuration_count = static_cast<std::uint32_t>(configuration_count(query));
}

QueryView view_of(const Query& query) {
  QueryView view = view_without_inputs(query);
  take_inputs(query, view);
  return view;
}

std::vector<BodyInfo> bodies_of(const engine::Scene& scene) {
  std::vector<BodyInfo> infos;
  for (const Body& body : scene.bodies()) {
    std::uint64_t vertices = 0;
    for (const ConvexPartPtr& part : body.parts) vertices += part->vertices.size();
    const Surface* const surface = surface_of(body);
    infos.push_back({body.name, body.parent, body.is_static, static_cast<std::uint32_t>(body.parts.size()), vertices,
                     body.model_error, extent_of(body), body.hull_excess, body.empty_share, triangle_count(body),
                     surface && surface->is_solid(), is_cloud(body)});
  }
  return infos;
}

std::vector<GroupInfo> groups_of(const engine::Scene& scene) {
  std::vector<GroupInfo> infos;
  for (const Group& group : scene.groups()) infos.push_back({group.name, group.bodies});
  return infos;
}

SceneInfo scene_info_of(const engine::Engine& engine) {
  SceneInfo info;
  info.revision = engine.scene_revision();
  info.bodies = bodies_of(engine.scene());
  for (std::uint32_t id = 0; id < info.bodies.size(); ++id) info.bodies[id].parent = engine.body_state(id).parent;
  info.groups = groups_of(engine.scene());
  info.pair_count = engine.pairs({}).size();
  info.backend = engine.backend();
  return info;
}

SceneInfo scene_names_of(const engine::Engine& engine) {
  SceneInfo info;
  info.revision = engine.scene_revision();
  for (const Body& body : engine.scene().bodies()) info.bodies.push_back({.name = body.name});
  for (std::uint32_t id = 0; id < info.bodies.size(); ++id) info.bodies[id].parent = engine.body_state(id).parent;
  for (const Group& group : engine.scene().groups()) info.groups.push_back({group.name, {}});
  return info;
}

JointsInfo joints_of(const engine::Engine& engine) {
  const engine::Scene& scene = engine.scene();
  JointsInfo info;
  info.scene_revision = engine.scene_revision();
  for (std::uint32_t id = 0; id < scene.joints().size(); ++id) {
    const SceneJoint& joint = scene.joints()[id];
    const JointState state = engine.joint_state(id);
    info.joints.push_back({joint.name, joint.lower, joint.upper, state.position, state.status, state.beyond_limits,
                           state.stamp_ns, state.receipt_ns ? monotonic_ns() - state.receipt_ns : -1});
  }
  for (const JointGroup& group : scene.joint_groups()) info.groups.push_back({group.name, group.joints});
  return info;
}

}  // namespace clearance
