#include "shapes.h"

#include <octomap/octomap.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>

namespace clearance_moveit {
namespace {

/// Part of the engine's error for a solid with an edge that belongs to one triangle.
constexpr std::string_view kOpenMesh = "the mesh is open there";

void add_mesh(clearance::Engine& engine, clearance::NewBody body, const shapes::Mesh& mesh) {
  std::vector<std::array<double, 3>> vertices(mesh.vertex_count);
  for (std::size_t i = 0; i < 3 * vertices.size(); ++i) vertices[i / 3][i % 3] = mesh.vertices[i];
  std::vector<std::array<std::uint32_t, 3>> triangles(mesh.triangle_count);
  for (std::size_t i = 0; i < 3 * triangles.size(); ++i) triangles[i / 3][i % 3] = mesh.triangles[i];
  if (triangles.empty()) throw std::invalid_argument("a mesh without triangles");
  body.vertices = vertices;
  body.triangles = triangles;
  body.mesh_as = clearance::MeshAs::kSolid;
  try {
    engine.add_body(body);
  } catch (const clearance::QueryError& error) {
    if (std::string_view(error.what()).find(kOpenMesh) == std::string_view::npos) throw;
    body.mesh_as = clearance::MeshAs::kSurface;
    engine.add_body(body);
  }
}

std::vector<std::string> add_octree(clearance::Engine& engine, const clearance::NewBody& body,
                                    const octomap::OcTree& tree) {
  std::map<double, std::vector<std::array<float, 3>>> centres;  // by edge
  double reach = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) continue;
    const octomap::point3d at = leaf.getCoordinate();
    centres[leaf.getSize()].push_back({at.x(), at.y(), at.z()});
    for (const float coordinate : {at.x(), at.y(), at.z()}) reach = std::max<double>(reach, std::abs(coordinate));
  }
  std::vector<std::string> names;
  for (const auto& [edge, points] : centres) {
    clearance::NewBody cells = body;
    cells.name += "." + std::to_string(names.size());
    cells.points = points;
    cells.voxel = edge;
    cells.padding += reach * 0x1p-22;  // rounding of the centres to float
    try {
      engine.add_body(cells);
    } catch (...) {
      for (; !names.empty(); names.pop_back()) engine.remove_body(names.back());
      throw;
    }
    names.push_back(cells.name);
  }
  return names;
}

}  // namespace

std::vector<std::string> add_shape(clearance::Engine& engine, const std::string& stem, const shapes::Shape& shape,
                                   const Placement& placement) {
  clearance::NewBody body{.name = stem, .parent = placement.parent, .pose = placement.pose};
  body.padding = placement.padding;
  std::unique_ptr<shapes::Shape> scaled;
  if (placement.scale != 1) {
    scaled.reset(shape.clone());
    scaled->scale(placement.scale);
  }
  const shapes::Shape& taken = scaled ? *scaled : shape;
  switch (taken.type) {
    case shapes::SPHERE:
      body.sphere = static_cast<const shapes::Sphere&>(taken).radius;
      break;
    case shapes::BOX:
      body.box = std::to_array(static_cast<const shapes::Box&>(taken).size);
      break;
    case shapes::CYLINDER: {
      const auto& cylinder = static_cast<const shapes::Cylinder&>(taken);
      body.cylinder = {cylinder.radius, cylinder.length};
      break;
    }
    case shapes::CONE: {
      const auto& cone = static_cast<const shapes::Cone&>(taken);
      body.cone = {cone.radius, cone.length};
      break;
    }
    case shapes::MESH:
      add_mesh(engine, body, static_cast<const shapes::Mesh&>(taken));
      return {stem};
    case shapes::OCTREE:
      if (placement.scale != 1) throw std::invalid_argument("an octree with a scale");
      return add_octree(engine, body, *static_cast<const shapes::OcTree&>(taken).octree);
    default:
      throw std::invalid_argument("shapes of type " + std::to_string(taken.type) + " are not supported");
  }
  engine.add_body(body);
  return {stem};
}

}  // namespace clearance_moveit
