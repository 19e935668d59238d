// The bodies of a scene as the report of 2023 stores them: meshes in world coordinates, transformed again for each
// query.
//
// The report is Y. Shi, B. Y. Su, "Parallel Minimum Distance Query Among Convex Meshes", CMU 15-418/618, 2023.
// docs/notes/report.md compares it with this implementation.
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

/// Data shared by bodies of the same shape: faces, and the neighbours of each vertex along them.
struct Connections {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> neighbours_begin;  ///< (V + 1,)
  std::vector<std::uint32_t> neighbours;
};

/// A convex triangle mesh in the world frame, in metres.
struct Mesh {
  std::span<const Vec3d> vertices;
  const Connections* connections = nullptr;
};

/// A body's range of World::vertices().
struct VertexRange {
  std::uint32_t first = 0, count = 0;
};

/// All meshes of a scene at the poses of its bodies.
class World {
 public:
  /// Uses each body's triangles, or those of its hull if its mesh has interior vertices, and places it at its initial
  /// pose, or at the origin without one. Throws std::invalid_argument for a body of several convex parts, with a
  /// radius, or without triangles (a flat one), which the report does not support.
  explicit World(const engine::Scene& scene);

  /// Moves every body.
  /// \param X_wb (bodies,)
  void place(std::span<const Pose> X_wb);

  std::size_t size() const { return ranges_.size(); }
  Mesh mesh(std::uint32_t body) const {
    return {std::span(vertices_).subspan(ranges_[body].first, ranges_[body].count), connections_[body].get()};
  }
  /// In the body's frame.
  const std::shared_ptr<const DisplayMesh>& body_mesh(std::uint32_t body) const { return meshes_[body]; }
  std::span<const Vec3d> vertices() const { return vertices_; }    ///< of all bodies, in sequence
  std::span<const VertexRange> ranges() const { return ranges_; }  ///< (bodies,)
  std::vector<Aabb> boxes() const;                                 ///< (bodies,) of their vertices

 private:
  std::vector<std::shared_ptr<const DisplayMesh>> meshes_;
  std::vector<std::shared_ptr<const Connections>> connections_;
  std::vector<VertexRange> ranges_;
  std::vector<Vec3d> vertices_;
};

}  // namespace clearance::baselines
