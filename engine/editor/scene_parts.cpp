#include "engine/editor/scene_parts.h"

#include <algorithm>

#include "engine/scene/body_checks.h"
#include "wire/api/unknown_name.h"

namespace clearance {

namespace {

void append(engine::Scene& scene, const AddedBody& added) {
  Body body = added.body;
  if (!added.parent.empty()) {
    body.parent = scene.find_body(added.parent);
    if (body.parent == kNone)
      throw engine::SceneError("body \"" + body.name + "\": parent: " + no_body(scene, added.parent));
  }
  scene.add_body(std::move(body));
}

void add_to(engine::Scene& scene, const std::string& name, const NewShape& shape,
            const engine::Scene::BodyOptions& options) {
  const auto [x, y, z] = shape.size;
  switch (shape.kind) {
    case wire::BodyShape::kHull:
      if (shape.triangles.empty())
        scene.add_hull(name, shape.vertices, options);
      else
        scene.add_mesh(name, shape.vertices, shape.triangles, shape.mesh_as, options);
      break;
    case wire::BodyShape::kBox:
      scene.add_box(name, {x, y, z}, options);
      break;
    case wire::BodyShape::kSphere:
      scene.add_sphere(name, x, options);
      break;
    case wire::BodyShape::kCapsule:
      scene.add_capsule(name, x, y, options);
      break;
    case wire::BodyShape::kCylinder:
      scene.add_cylinder(name, x, y, options);
      break;
    case wire::BodyShape::kCone:
      scene.add_cone(name, x, y, options);
      break;
    case wire::BodyShape::kEllipsoid:
      scene.add_ellipsoid(name, {x, y, z}, options);
      break;
    case wire::BodyShape::kHalfSpace:
      scene.add_half_space(name, options);
      break;
    case wire::BodyShape::kCloud:
      scene.add_points(name, shape.points, x, options);
      break;
  }
}

}  // namespace

AddedBody make_body(const std::string& name, const NewShape& shape, engine::Scene::BodyOptions options) {
  AddedBody added{{}, std::exchange(options.parent, {})};
  engine::Scene alone;
  add_to(alone, name, shape, options);
  added.body = alone.bodies()[0];
  if (!options.pose) added.body.pose.reset();  // whether it is the identity depends on its parent
  return added;
}

engine::Scene SceneParts::whole() const {
  engine::Scene scene = *loaded;  // convex parts are shared, not copied
  for (const AddedBody& body : added) append(scene, body);
  for (const auto& [name, shape] : reshaped) scene.replace_shape(name, shape);
  return scene;
}

engine::Scene SceneParts::whole_as_far_as_possible(std::string& dropped) {
  engine::Scene scene = *loaded;
  const auto fits = [&](auto&& change) {
    try {
      change();
      return true;
    } catch (const engine::SceneError& error) {
      dropped += (dropped.empty() ? "" : "; ") + std::string(error.what());
      return false;
    }
  };
  std::erase_if(added, [&](const AddedBody& body) { return !fits([&] { append(scene, body); }); });
  std::erase_if(reshaped, [&](const auto& of) { return !fits([&] { scene.replace_shape(of.first, of.second); }); });
  return scene;
}

bool SceneParts::was_added(std::string_view name) const {
  return std::any_of(added.begin(), added.end(), [&](const AddedBody& of) { return of.body.name == name; });
}

void SceneParts::check_added(const std::string& name, const std::string& who, const char* why) const {
  if (was_added(name)) return;
  if (loaded->find_body(name) != kNone)
    throw engine::SceneError(who + in_quotes(name) + " was loaded with the scene: " + why);
  std::vector<std::string_view> names = all_names(loaded->bodies());
  for (const AddedBody& other : added) names.push_back(other.body.name);
  throw engine::SceneError(who + in_quotes(name) + " is not in the scene" + did_you_mean(name, names));
}

void SceneParts::remove(const std::string& name) {
  check_added(name, "remove_body: ", "only added bodies can be removed");
  std::erase_if(added, [&](const AddedBody& of) { return of.body.name == name; });
  std::erase_if(reshaped, [&](const auto& of) { return of.first == name; });
  for (AddedBody& other : added)  // former children, detached since: see why_not_removed()
    if (other.parent == name) {
      other.parent.clear();
      other.body.pose.reset();
    }
}

void SceneParts::reshape(const std::string& name, const NewShape& shape, double radius) {
  engine::Scene::BodyOptions options;
  options.radius = radius;
  Geometry geometry = make_body(name, shape, options).body;
  const auto found = std::find_if(reshaped.begin(), reshaped.end(), [&](const auto& of) { return of.first == name; });
  if (found == reshaped.end())
    reshaped.emplace_back(name, std::move(geometry));
  else
    found->second = std::move(geometry);
}

}  // namespace clearance
