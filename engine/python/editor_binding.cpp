#include "engine/python/editor_binding.h"

#include <nanobind/stl/vector.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <vector>

#include "engine/python/scene_bindings.h"

namespace clearance::python {
namespace {

/// By wire::BodyShape; a "mesh" is a hull with triangles.
constexpr const char* kShapes[] = {"vertices",   "box",  "sphere",    "capsule", "cylinder",
                                   "half_space", "cone", "ellipsoid", "points"};

template <class T, class Rows>
std::vector<T> copied(const Rows& rows) {
  const std::span<const T> all = rows_of<T>(rows);
  return {all.begin(), all.end()};
}

NewShape new_shape(const std::string& shape, const PyEditor::VertexRows& numbers,
                   const PyEditor::TriangleRows& triangles, int mesh_as, const CloudRows& cloud) {
  const auto* const kind = std::find(std::begin(kShapes), std::end(kShapes), shape == "mesh" ? "vertices" : shape);
  if (kind == std::end(kShapes)) throw std::invalid_argument("shape: unknown shape " + shape);
  NewShape made{static_cast<wire::BodyShape>(kind - kShapes)};
  if (made.kind == wire::BodyShape::kHull)
    made.vertices = copied<Vec3d>(numbers);
  else if (numbers.shape(0) > 0)
    made.size = {numbers.data()[0], numbers.data()[1], numbers.data()[2]};
  made.triangles = copied<Triangle>(triangles);
  made.mesh_as = static_cast<MeshAs>(mesh_as);
  made.points = copied<CloudPoint>(cloud);
  return made;
}

[[noreturn]] void reject_scene(const engine::Engine& engine, std::uint64_t revision) {
  throw engine::QueryError(QueryErrorCode::kWrongScene,
                           "the scene is revision " + std::to_string(engine.scene_revision()) +
                               ", and ids have changed their meaning since revision " + std::to_string(revision));
}

}  // namespace

void check_ids(const engine::Engine& engine, std::uint64_t revision, std::span<const std::uint32_t> ids,
               bool with_parents) {
  if (!engine.names_valid_since(revision, ids, with_parents)) reject_scene(engine, revision);
}

void check_query_ids(const engine::Engine& engine, std::uint64_t revision, const QueryView& query) {
  if (revision == 0 || revision == engine.scene_revision()) return;
  check_ids(engine, revision, query.bodies);
  if (!query.pairs.empty()) check_ids(engine, revision, {&query.pairs[0].a, 2 * query.pairs.size()});
  for (const MarginEntry& entry : query.margins) check_ids(engine, revision, std::array{entry.a, entry.b});
  if (!engine.joints_still_mean(revision, query.joints)) reject_scene(engine, revision);
}

template <class F>
nb::tuple PyEditor::change(F&& f) {
  guard_.check("this Engine");
  const SceneEditor::Change done = [&] {
    const GilRelease release;
    return f(*editor_);
  }();
  return nb::make_tuple(done.engine->scene_revision(), done.engine->scene().bodies().size(), done.body, done.seconds);
}

nb::tuple PyEditor::add_body(const std::string& name, const std::string& shape, const VertexRows& numbers,
                             double radius, std::uint32_t parent, bool is_static, const std::optional<PoseRows>& pose,
                             const std::array<double, 4>& uncertainties, const TriangleRows& triangles, int mesh_as,
                             const CloudRows& cloud, std::uint64_t revision) {
  const NewShape made = new_shape(shape, numbers, triangles, mesh_as, cloud);
  engine::Scene::BodyOptions options;
  options.radius = radius;
  options.is_static = is_static;
  if (pose) options.pose = pose_from(pose->data());
  options.uncertainty = {uncertainties[0], uncertainties[1]};
  options.padding = uncertainties[2];
  options.max_speed = uncertainties[3];
  const auto make = [&](const engine::Engine& engine) {
    if (parent != kNone) {
      check_ids(engine, revision, {&parent, 1});
      if (parent >= engine.scene().bodies().size())
        throw engine::SceneError("add_body: the parent, body " + std::to_string(parent) + ", is not in the scene");
      options.parent = engine.scene().bodies()[parent].name;
    }
    return make_body(name, made, options);
  };
  return change([&](SceneEditor& editor) { return editor.add(make); });
}

nb::tuple PyEditor::remove_body(const std::string& name) {
  return change([&](SceneEditor& editor) { return editor.remove(name); });
}

nb::tuple PyEditor::replace(const std::string& name, const std::string& shape, const VertexRows& numbers, double radius,
                            const TriangleRows& triangles, int mesh_as, const CloudRows& cloud) {
  const NewShape made = new_shape(shape, numbers, triangles, mesh_as, cloud);
  return change([&](SceneEditor& editor) { return editor.reshape(name, made, radius); });
}

nb::tuple PyEditor::scene_state() const {
  const std::shared_ptr<engine::Engine> engine = use();
  std::uint64_t revision = 0;
  std::vector<std::uint32_t> parents(engine->scene().bodies().size());
  do {
    revision = engine->scene_revision();
    for (std::uint32_t i = 0; i < parents.size(); ++i) parents[i] = engine->body_state(i).parent;
  } while (engine->scene_revision() != revision);
  return nb::make_tuple(engine->scene(), revision, parents);
}

}  // namespace clearance::python
