#include "bench/report/world.h"

#include <algorithm>
#include <stdexcept>

#include "engine/hull/hull.h"

namespace clearance::baselines {

namespace {

std::shared_ptr<const Connections> connect(const DisplayMesh& mesh) {
  auto c = std::make_shared<Connections>();
  c->triangles = mesh.triangles;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  edges.reserve(6 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t p = t[i], q = t[(i + 1) % 3];
      edges.push_back({p, q});
      edges.push_back({q, p});
    }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  c->neighbours_begin.assign(mesh.vertices.size() + 1, 0);
  for (const auto& [from, to] : edges) {
    ++c->neighbours_begin[from + 1];
    c->neighbours.push_back(to);
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) c->neighbours_begin[v + 1] += c->neighbours_begin[v];
  return c;
}

/// The hull's own faces, for a body whose mesh has more vertices.
std::shared_ptr<const DisplayMesh> hull_of(const ConvexPart& part) {
  auto mesh = std::make_shared<DisplayMesh>();
  mesh->vertices = make_hull_part(part.vertices, {}, 0, 0, true, &mesh->triangles)->vertices;
  return mesh;
}

}  // namespace

World::World(const engine::Scene& scene) {
  struct Shared {
    std::shared_ptr<const DisplayMesh> mesh;
    std::shared_ptr<const Connections> connections;
  };
  std::map<const ConvexPart*, Shared> known;
  std::vector<Pose> poses;
  std::uint32_t first = 0;
  for (const Body& body : scene.bodies()) {
    const auto refuse = [&](const char* why) {
      throw std::invalid_argument("body \"" + body.name + "\" " + why + ": the baselines take single convex meshes");
    };
    if (body.parts.size() != 1) refuse("has several pieces");
    if (body.parts[0]->radius > 0) refuse("has a radius");
    Shared& shared = known[body.parts[0].get()];
    if (!shared.mesh) {
      const bool plain = body.display && body.display->vertices.size() == body.parts[0]->vertices.size();
      shared.mesh = plain ? body.display : hull_of(*body.parts[0]);
      shared.connections = connect(*shared.mesh);
    }
    if (shared.mesh->triangles.empty()) refuse("has no triangles");
    meshes_.push_back(shared.mesh);
    connections_.push_back(shared.connections);
    const auto count = static_cast<std::uint32_t>(shared.mesh->vertices.size());
    ranges_.push_back({first, count});
    first += count;
    poses.push_back(body.pose.value_or(Pose{}));
  }
  vertices_.resize(first);
  place(poses);
}

void World::place(std::span<const Pose> X_wb) {
  for (std::size_t b = 0; b < ranges_.size(); ++b) {
    const Mat3d R_wb = rotation_of(X_wb[b]);
    Vec3d* out = &vertices_[ranges_[b].first];
    for (const Vec3d& v : meshes_[b]->vertices) *out++ = R_wb * v + X_wb[b].translation;
  }
}

std::vector<Aabb> World::boxes() const {
  std::vector<Aabb> boxes;
  for (std::uint32_t b = 0; b < size(); ++b) {
    const std::span<const Vec3d> vertices = mesh(b).vertices;
    Aabb box{vertices[0], vertices[0]};
    for (const Vec3d& v : vertices)
      for (int k = 0; k < 3; ++k) {
        box.low[k] = std::min(box.low[k], v[k]);
        box.high[k] = std::max(box.high[k], v[k]);
      }
    boxes.push_back(box);
  }
  return boxes;
}

}  // namespace clearance::baselines
