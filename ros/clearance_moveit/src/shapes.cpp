#include <octomap/octomap.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>
#include <string_view>

#include "bodies.h"

namespace clearance_moveit {
namespace {

/// Part of the engine's error for a solid with an edge that belongs to one triangle.
constexpr std::string_view kOpenMesh = "the mesh is open there";

void add_mesh(clearance::Engine& engine, clearance::NewBody& body, const shapes::Mesh& mesh) {
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

void add_octree(clearance::Engine& engine, const clearance::NewBody& body, const octomap::OcTree& tree,
                std::vector<std::string>& names) {
  std::map<double, std::vector<std::array<float, 3>>> centres;  // by edge
  double reach = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) continue;
    const octomap::point3d at = leaf.getCoordinate();
    centres[leaf.getSize()].push_back({at.x(), at.y(), at.z()});
    for (const float coordinate : {at.x(), at.y(), at.z()}) reach = std::max<double>(reach, std::abs(coordinate));
  }
  for (const auto& [edge, points] : centres) {
    clearance::NewBody cells = body;
    cells.name = body.name + "." + std::to_string(names.size());
    cells.points = points;
    cells.voxel = edge;
    cells.padding += reach * 0x1p-22;  // rounding of the centres to float
    engine.add_body(cells);
    names.push_back(cells.name);
  }
}

void append_cells(const octomap::OcTree& tree, const octomap::OcTreeNode& node, std::string& cells) {
  if (!tree.nodeHasChildren(&node)) return cells.push_back(tree.isNodeOccupied(node) ? 'o' : 'f');
  cells.push_back('(');
  for (unsigned i = 0; i < 8; ++i)
    if (tree.nodeChildExists(&node, i))
      append_cells(tree, *tree.getNodeChild(&node, i), cells);
    else
      cells.push_back('-');
}

}  // namespace

std::string cells_of(const std::vector<shapes::ShapeConstPtr>& shapes) {
  std::string cells;
  for (const auto& shape : shapes) {
    if (shape->type != shapes::OCTREE) continue;
    const octomap::OcTree& tree = *static_cast<const shapes::OcTree&>(*shape).octree;
    cells += std::to_string(tree.getResolution()) + ':';
    if (tree.getRoot()) append_cells(tree, *tree.getRoot(), cells);
  }
  return cells;
}

void add_shape(clearance::Engine& engine, clearance::NewBody body, const shapes::Shape& shape, double scale,
               std::vector<std::string>& names) {
  const std::unique_ptr<shapes::Shape> scaled(scale == 1 ? nullptr : shape.clone());
  if (scaled) scaled->scale(scale);
  const shapes::Shape& taken = scaled ? *scaled : shape;
  const std::string name = body.name;
  if (taken.type == shapes::SPHERE) {
    body.sphere = static_cast<const shapes::Sphere&>(taken).radius;
  } else if (taken.type == shapes::BOX) {
    body.box = std::to_array(static_cast<const shapes::Box&>(taken).size);
  } else if (taken.type == shapes::CYLINDER) {
    const auto& cylinder = static_cast<const shapes::Cylinder&>(taken);
    body.cylinder = {cylinder.radius, cylinder.length};
  } else if (taken.type == shapes::CONE) {
    const auto& cone = static_cast<const shapes::Cone&>(taken);
    body.cone = {cone.radius, cone.length};
  } else if (taken.type == shapes::OCTREE && scale == 1) {
    return add_octree(engine, body, *static_cast<const shapes::OcTree&>(taken).octree, names);
  } else if (taken.type != shapes::MESH) {
    throw std::invalid_argument("shapes of type " + std::to_string(taken.type) + (scaled ? " with a scale" : "") +
                                " are not supported");
  }
  if (taken.type == shapes::MESH)
    add_mesh(engine, body, static_cast<const shapes::Mesh&>(taken));
  else
    engine.add_body(body);
  names.push_back(name);
}

}  // namespace clearance_moveit
