// Changes of the scene of an installed Engine.
#include "engine/api/engine_impl.h"
#include "wire/api/new_body.h"

namespace clearance {
namespace {

/// The shape of a body, of which there must be one.
NewShape shape_of(const NewBody& body, const char* call) {
  NewShape shape;
  int shapes = 0;
  const auto take = [&](bool is_given, wire::BodyShape kind, Vec3d size) {
    if (!is_given) return;
    shape.kind = kind;
    shape.size = size;
    ++shapes;
  };
  const auto sizes = [](const auto& given) {
    Vec3d size{};
    double* const to[] = {&size.x, &size.y, &size.z};
    for (std::size_t i = 0; given && i < given->size(); ++i) *to[i] = (*given)[i];
    return size;
  };
  take(!body.vertices.empty(), wire::BodyShape::kHull, {});
  take(body.box.has_value(), wire::BodyShape::kBox, sizes(body.box));
  take(body.sphere.has_value(), wire::BodyShape::kSphere, {body.sphere.value_or(0), 0, 0});
  take(body.capsule.has_value(), wire::BodyShape::kCapsule, sizes(body.capsule));
  take(body.cylinder.has_value(), wire::BodyShape::kCylinder, sizes(body.cylinder));
  take(body.cone.has_value(), wire::BodyShape::kCone, sizes(body.cone));
  take(body.ellipsoid.has_value(), wire::BodyShape::kEllipsoid, sizes(body.ellipsoid));
  take(body.half_space, wire::BodyShape::kHalfSpace, {});
  take(body.points.has_value(), wire::BodyShape::kCloud, {body.voxel, 0, 0});
  if (shapes != 1)
    throw std::invalid_argument(std::string(call) +
                                ": expected one of vertices, box, sphere, capsule, cylinder, cone, ellipsoid, "
                                "half_space and points, got " +
                                std::to_string(shapes));
  if (!body.triangles.empty() && body.vertices.empty())
    throw std::invalid_argument(std::string(call) + ": triangles are only for vertices");
  for (const auto& [x, y, z] : body.vertices) shape.vertices.push_back({x, y, z});
  shape.triangles.assign(body.triangles.begin(), body.triangles.end());
  shape.mesh_as = body.mesh_as;
  if (body.points)
    for (const auto& [x, y, z] : *body.points) shape.points.push_back({x, y, z});
  return shape;
}

SceneChanged changed(const SceneEditor::Change& done) {
  return {done.engine->scene_revision(), static_cast<std::uint32_t>(done.engine->scene().bodies().size()), done.body,
          done.seconds};
}

}  // namespace

SceneChanged Engine::add_body(const NewBody& body) {
  const NewShape shape = shape_of(body, "add_body");
  engine::Scene::BodyOptions options;
  options.radius = body.radius;
  options.is_static = body.is_static;
  if (body.pose) options.pose = pose_of(*body.pose);
  options.uncertainty = {body.uncertainty_position, body.uncertainty_angle};
  options.padding = body.padding;
  options.max_speed = body.max_speed;
  const auto make = [&](const engine::Engine& engine) {
    if (body.parent != kNone) {
      if (body.parent >= engine.scene().bodies().size())
        throw engine::SceneError("add_body: the parent, body " + std::to_string(body.parent) + ", is not in the scene");
      options.parent = engine.scene().bodies()[body.parent].name;
    }
    return make_body(body.name, shape, options);
  };
  return translated([&] { return changed(impl_->editor.add(make)); });
}

SceneChanged Engine::remove_body(std::string_view name) {
  return translated([&] { return changed(impl_->editor.remove(std::string(name))); });
}

SceneChanged Engine::replace(const NewBody& shape) {
  const NewShape made = shape_of(shape, "replace");
  return translated([&] { return changed(impl_->editor.reshape(shape.name, made, shape.radius)); });
}

}  // namespace clearance
