// The bodies of a scene as the report of 2023 keeps them: meshes in world coordinates, moved anew for each query.
//
// The report is Y. Shi, B. Y. Su, "Parallel Minimum Distance Query Among Convex Meshes", CMU 15-418/618, 2023.
// docs/report.md compares it with what is here.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/hull/shapes.h"
#include "engine/narrow/certify.h"
#include "engine/pose/pose.h"
#include "engine/scene/scene.h"

namespace clearance::baselines {

/// What bodies of the same shape share: faces, and the neighbours of each vertex along them.
struct Connections {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> neighbours_begin;  ///< (V + 1,)
  std::vector<std::uint32_t> neighbours;
};

/// A convex triangle mesh in the world, metres.
struct Mesh {
  std::span<const Vec3d> vertices;
  const Connections* connections = nullptr;
};

/// Which of World::vertices() are a body's.
struct VertexRange {
  std::uint32_t first = 0, count = 0;
};

/// All meshes of a scene where its bodies are.
class World {
 public:
  /// Takes each body's triangles, those of its hull if its mesh has vertices inside, and places it at its initial pose,
  /// the origin without one. Throws std::invalid_argument for a body of several pieces, with a radius, or without
  /// triangles (a flat one): the report knows neither.
  explicit World(const Scene& scene);

  /// Moves every body. \param X_wb (bodies,)
  void place(std::span<const Pose> X_wb);

  std::size_t size() const { return ranges_.size(); }
  Mesh mesh(std::uint32_t body) const {
    return {std::span(vertices_).subspan(ranges_[body].first, ranges_[body].count), connections_[body].get()};
  }
  /// In the body's frame.
  const std::shared_ptr<const DisplayMesh>& body_mesh(std::uint32_t body) const { return meshes_[body]; }
  std::span<const Vec3d> vertices() const { return vertices_; }    ///< of all bodies, one body after another
  std::span<const VertexRange> ranges() const { return ranges_; }  ///< (bodies,)
  std::vector<Aabb> boxes() const;                                 ///< (bodies,) of their vertices

 private:
  std::vector<std::shared_ptr<const DisplayMesh>> meshes_;
  std::vector<std::shared_ptr<const Connections>> connections_;
  std::vector<VertexRange> ranges_;
  std::vector<Vec3d> vertices_;
};

}  // namespace clearance::baselines
