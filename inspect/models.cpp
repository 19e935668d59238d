#include "inspect/models.h"

#include <algorithm>
#include <map>
#include <utility>

namespace clearance {

namespace {

using Mesh = std::pair<const DisplayMesh*, double>;  // and the radius by which it is grown

// The hull of a mesh, and the exact mesh in its place.
struct Alternatives {
  const Choice *hull = nullptr, *exact = nullptr;
};

Mesh mesh_of(const Body& body) {
  return {body.display.get(), body.parts.empty() ? 0 : body.parts[0]->radius};
}

std::map<Mesh, Alternatives> alternatives_of(const engine::Scene& scene, const std::vector<Choice>& choices) {
  std::map<Mesh, Alternatives> found;
  for (const Choice& choice : choices) {
    Alternatives& mine = found[mesh_of(scene.bodies()[choice.body])];
    if (choice.what == MeshAs::kHull)
      mine.hull = &choice;
    else if (choice.what == MeshAs::kSurface ? !mine.exact : choice.what == MeshAs::kSolid)
      mine.exact = &choice;
  }
  return found;
}

std::string group_of(const engine::Scene& scene, const Body& body) {
  if (body.robot != kNone) return scene.robots()[body.robot]->name;
  if (is_cloud(body)) return "clouds";
  return body.is_static ? "static bodies" : "movable bodies";
}

// Sums of the measured times of a group's pairs.
struct Times {
  double hulls = 0, meshes = 0;
};

void add_hull(GroupModel& group, std::uint32_t id, double excess, MeshAs better, double margin) {
  ++group.concave;
  if (excess > margin) group.true_meshes.push_back({id, better});
  if (excess <= group.hull_excess) return;
  group.hull_excess = excess;
  group.farthest = id;
}

void add_mesh(GroupModel& group, Times& times, std::uint32_t id, const Alternatives& of, double margin) {
  add_hull(group, id, of.hull->hull_excess, of.exact->what, margin);
  group.elements += of.exact->triangles;
  group.hull_vertices += of.hull->vertices;
  if (!of.hull->ns_per_pair || !of.exact->ns_per_pair) return;
  times.hulls += *of.hull->ns_per_pair;
  times.meshes += *of.exact->ns_per_pair;
}

}  // namespace

std::vector<GroupModel> models_of(const engine::Scene& scene, const std::vector<Choice>& choices, double margin) {
  const std::map<Mesh, Alternatives> alternatives = alternatives_of(scene, choices);
  std::vector<GroupModel> groups;
  std::vector<Times> times;
  for (const auto& robot : scene.robots()) groups.emplace_back().group = robot->name;
  for (const char* name : {"movable bodies", "static bodies", "clouds"}) groups.emplace_back().group = name;
  times.resize(groups.size());
  for (std::uint32_t id = 0; id < scene.bodies().size(); ++id) {
    const Body& body = scene.bodies()[id];
    const auto place = std::ranges::find(groups, group_of(scene, body), &GroupModel::group) - groups.begin();
    GroupModel& group = groups[static_cast<std::size_t>(place)];
    if (is_cloud(body)) {
      ++group.bodies;
      group.elements += point_count(body);
      continue;
    }
    if (body.parts.empty()) continue;
    ++group.bodies;
    if (const auto of = alternatives.find(mesh_of(body)); of != alternatives.end() && of->second.exact) {
      add_mesh(group, times[static_cast<std::size_t>(place)], id, of->second, margin);
    } else if (has_surface(body)) {
      ++group.concave;
      ++group.unknown;
    } else if (body.hull_excess > 0) {
      add_hull(group, id, body.hull_excess, MeshAs::kAuto, margin);
    }
  }
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (times[i].hulls > 0) groups[i].cost_ratio = times[i].meshes / times[i].hulls;
  std::erase_if(groups, [](const GroupModel& group) { return group.bodies == 0; });
  return groups;
}

}  // namespace clearance
