// Moving meshes with a fixed mesh and with bodies that a device cannot evaluate against a mesh.
#pragma once

#include <vector>

#include "tests/engine/cuda/element_case.h"
#include "tests/oracle/cases/mesh_shapes.h"

namespace clearance::test {

/// Links that are meshes, with a shelf that is a mesh, a hull, a cloud, and bodies that the device cannot evaluate.
struct MeshCase {
  std::uint32_t shelf, hull, cloud, nothing, several;
  std::vector<std::uint32_t> links;

  explicit MeshCase(std::uint32_t configurations, double room, std::uint64_t seed) {
    Random random(seed);
    exact::Random shapes(seed);
    const auto add = [&](const std::string& name, exact::Mesh mesh, double size, bool is_solid,
                         const engine::Scene::BodyOptions& options) {
      mesh = exact::scaled(std::move(mesh), {size, size, size});
      scene.add_mesh(name, mesh.vertices, mesh.triangles, is_solid ? MeshAs::kSolid : MeshAs::kSurface, options);
      return static_cast<std::uint32_t>(scene.bodies().size() - 1);
    };
    links = {add("ring", exact::ring(shapes), 0.2, true, {}), add("bent", exact::bent(shapes), 0.2, true, {}),
             add("comb", exact::comb(shapes, 0.05), 0.2, false, {}),
             add("ball", exact::ball(shapes), 0.1, true, {.radius = 0.01})};
    const MeshOfCase mesh(2);
    scene.add_mesh("shelf", mesh.vertices, mesh.triangles, MeshAs::kSolid,
                   {.is_static = true, .pose = random.pose(0.2)});
    shelf = static_cast<std::uint32_t>(scene.bodies().size() - 1);
    scene.add_hull("hull", cloud_on_sphere(60, 0.3, 4), {.is_static = true, .pose = random.pose(0.5)});
    hull = shelf + 1;
    scene.add_points("cloud", points_of_case(random, 60, 0), 0, {.is_static = true, .pose = random.pose(0.5)});
    cloud = hull + 1;
    scene.add_points("nothing", std::vector<CloudPoint>(), 0, {.is_static = true, .pose = random.pose(0.5)});
    nothing = cloud + 1;
    Body both;
    both.name = "several";
    both.parts = {scene.bodies()[links[0]].parts[0],
                  make_convex_part({{0.3, 0, 0}, {0.5, 0, 0}, {0.4, 0.2, 0}, {0.4, 0, 0.3}})};
    both.is_static = true;
    both.pose = random.pose(0.5);
    scene.add_body(std::move(both));
    several = nothing + 1;
    for (std::size_t i = 0; i < configurations * links.size(); ++i) poses.push_back(random.pose(room));
    q.all_pairs = false;
    q.fields = kAllFields;
    q.configuration_count = configurations;
  }
  /// Links with the shelf and each other, and with the hull.
  std::vector<BodyPair> pairs_of_meshes() const {
    std::vector<BodyPair> of;
    for (const std::uint32_t link : links) of.push_back(link % 2 ? BodyPair{link, shelf} : BodyPair{shelf, link});
    for (std::size_t i = 1; i < links.size(); ++i) of.push_back({links[i - 1], links[i]});
    for (const std::uint32_t link : links) of.push_back({link, hull});
    return of;
  }
  /// Links with all fixed bodies; the device cannot evaluate three of the five kinds.
  std::vector<BodyPair> pairs_of_all() const {
    std::vector<BodyPair> of;
    for (const std::uint32_t link : links)
      for (const std::uint32_t other : {hull, cloud, nothing, several, shelf}) of.push_back({other, link});
    return of;
  }
  void request_about(std::vector<BodyPair> of) {
    pairs = std::move(of);
    q.pairs = pairs;
    q.bodies = links;
    q.configurations = poses;
  }

  engine::Scene scene;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;
};

}  // namespace clearance::test
