#include "cli/inspect_models.h"

#include <algorithm>
#include <cstdio>
#include <string>

namespace clearance::cli {
namespace {

// Error and cost of the models of one group of bodies.
void print_model(const engine::Scene& scene, const GroupModel& g) {
  std::printf("%s (%zu): ", g.group.c_str(), g.bodies);
  if (g.group == "clouds") {
    std::printf("%llu points, exact; no hull can replace them\n", static_cast<unsigned long long>(g.elements));
    return;
  }
  if (g.concave == 0) {
    std::printf("convex, so hulls are exact\n");
    return;
  }
  std::printf("%zu not convex; ", g.concave);
  if (g.farthest != kNone)
    std::printf("with hulls, distances are up to %.3g mm too small (%s); ", 1e3 * g.hull_excess,
                scene.bodies()[g.farthest].name.c_str());
  if (g.cost_ratio)
    std::printf("true meshes cost %.2g times as much (measured now: poses at load, without covers)", *g.cost_ratio);
  else if (g.elements > 0)
    std::printf("true meshes have %llu triangles, hulls %llu vertices (times not measured)",
                static_cast<unsigned long long>(g.elements), static_cast<unsigned long long>(g.hull_vertices));
  if (g.unknown > 0) std::printf("; %zu of several meshes, not compared", g.unknown);
  std::printf("\n");
}

std::string mesh_names(const engine::Scene& scene, const std::vector<MeshModel>& bodies, MeshAs mesh_as) {
  constexpr std::size_t kMost = 4;
  std::string text;
  std::size_t count = 0;
  for (const MeshModel& body : bodies)
    if (body.mesh_as == mesh_as && ++count <= kMost) text += (count > 1 ? ", " : "") + scene.bodies()[body.body].name;
  return count > kMost ? text + " and " + std::to_string(count - kMost) + " more" : text;
}

}  // namespace

Table table_of_models(const engine::Scene& scene, const std::vector<GroupModel>& models) {
  Table table({"group", "bodies", "not_convex", "hull_excess_m", "farthest", "elements", "hull_vertices", "cost_ratio",
               "true_meshes"});
  for (const GroupModel& g : models)
    table.add({g.group, g.bodies, g.concave, Cell(g.hull_excess, 3),
               g.farthest == kNone ? Cell() : Cell(scene.bodies()[g.farthest].name), g.elements, g.hull_vertices,
               g.cost_ratio ? Cell(*g.cost_ratio, 3) : Cell(), g.true_meshes.size()});
  return table;
}

void print_models(const engine::Scene& scene, const std::vector<GroupModel>& models, double margin) {
  std::vector<MeshModel> meshes;
  for (const GroupModel& g : models) {
    print_model(scene, g);
    meshes.insert(meshes.end(), g.true_meshes.begin(), g.true_meshes.end());
  }
  std::printf("For decisions by %g mm, ", 1e3 * margin);
  if (meshes.empty()) {
    std::printf("hulls are precise enough: mesh_as: hull\n");
    return;
  }
  std::printf("hulls stand out too far: ");
  for (const MeshAs mesh_as : {MeshAs::kSolid, MeshAs::kSurface, MeshAs::kAuto})
    if (const std::string names = mesh_names(scene, meshes, mesh_as); !names.empty())
      std::printf("mesh_as: %s for %s; ", std::string(word_of(mesh_as)).c_str(), names.c_str());
  std::printf("mesh_as: hull for the others\n");
}

}  // namespace clearance::cli
