// Closed meshes on a lattice, and good and bad convex parts for them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/bvh/surface.h"
#include "tests/oracle/cases/mesh_shapes.h"

namespace clearance::exact {

inline constexpr double kStep = 0x1p-24;  // of the lattice; samples are combinations of vertices in 64ths

inline Vec3d on_lattice(const Vec3d& v) {
  return {std::round(v.x / kStep) * kStep, std::round(v.y / kStep) * kStep, std::round(v.z / kStep) * kStep};
}
inline Mesh on_lattice(Mesh mesh) {
  for (Vec3d& v : mesh.vertices) v = on_lattice(v);
  return mesh;
}

using ConvexParts = std::vector<std::vector<Vec3d>>;

/// The triangles nearest to each of some points as hulls: together they contain all triangles.
inline ConvexParts clusters(Random& random, const Mesh& mesh, int count) {
  std::vector<Vec3d> seeds;
  const auto middle = [&](const Triangle& t) {
    return (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) * (1.0 / 3);
  };
  for (int i = 0; i < count; ++i) {
    const int at = random.integer(0, static_cast<int>(mesh.triangles.size()) - 1);
    seeds.push_back(middle(mesh.triangles[static_cast<std::size_t>(at)]));
  }
  ConvexParts parts(seeds.size());
  for (const Triangle& t : mesh.triangles) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < seeds.size(); ++i)
      if (squared_norm(seeds[i] - middle(t)) < squared_norm(seeds[best] - middle(t))) best = i;
    for (const std::uint32_t corner : t) parts[best].push_back(mesh.vertices[corner]);
  }
  std::erase_if(parts, [](const std::vector<Vec3d>& part) { return part.empty(); });
  return parts;
}

enum class Kind { kFlat, kWhole, kClusters, kShrunk, kLeftOut, kShaken };
inline constexpr std::array<Kind, 6> kKinds = {Kind::kFlat,   Kind::kWhole,   Kind::kClusters,
                                               Kind::kShrunk, Kind::kLeftOut, Kind::kShaken};

inline ConvexParts propose(Random& random, const Mesh& mesh, Kind kind) {
  ConvexParts parts = clusters(random, mesh, kind == Kind::kWhole ? 1 : random.integer(3, 8));
  if (kind == Kind::kLeftOut && parts.size() > 1) parts.erase(parts.begin());
  const double by = random.uniform(0.8, 0.99), length = random.log_uniform(1e-4, 0.1);
  for (std::vector<Vec3d>& part : parts) {
    Vec3d centre{0, 0, 0};
    for (const Vec3d& v : part) centre += v * (1.0 / static_cast<double>(part.size()));
    for (Vec3d& v : part) {
      if (kind == Kind::kShrunk) v = centre + (v - centre) * by;
      if (kind == Kind::kFlat) v.z = centre.z;
      if (kind == Kind::kShaken) v += random.direction() * (length * random.uniform());
      v = on_lattice(v);
    }
  }
  return parts;
}

inline double size_of(const Mesh& mesh) {
  Vec3d low = mesh.vertices[0], high = low;
  for (const Vec3d& v : mesh.vertices)
    for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
  return norm(high - low);
}

/// \param most maximum number of triangles
inline Mesh concave_mesh(Random& random, std::size_t most) {
  for (;;) {
    Mesh mesh = on_lattice(any_mesh(random));
    if (mesh.triangles.size() <= most && open_edge(mesh.vertices, mesh.triangles).empty()) return mesh;
  }
}

}  // namespace clearance::exact
