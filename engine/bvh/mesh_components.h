// Connected components of a mesh: orientation, volume and box of each.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance {

/// Triangles connected by their vertices.
struct MeshComponent {
  double volume = 0, area = 0;
  /// Its box, relative to the first corner of the first triangle of the mesh.
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};

  double size() const { return norm(high - low); }
  /// Whether it has hardly any volume.
  bool is_thin() const { return std::abs(volume) <= 1e-3 * area * size(); }
  bool meets(const MeshComponent& other) const {
    for (int k = 0; k < 3; ++k)
      if (low[k] > other.high[k] || other.low[k] > high[k]) return false;
    return true;
  }
};

struct MeshComponents {
  std::vector<std::uint32_t> of;  ///< component of each triangle
  std::vector<MeshComponent> all;
  bool has_busy_edges = false;  ///< edges of more than two triangles
};

/// Takes time about linear in the size of the mesh, which has triangles.
MeshComponents components_of(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

}  // namespace clearance
