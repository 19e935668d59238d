// A mesh of boxes whose faces are grids of triangles.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance::test {

struct BoxMesh {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;

  /// \param cells along each edge
  /// \param inward whether its triangles face inward: a cavity, or a solid of winding number -1
  void add_box(const Vec3d& centre, const Vec3d& half, std::uint32_t cells, bool inward) {
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      const double side = face % 2 ? 1 : -1;
      const auto first = static_cast<std::uint32_t>(vertices.size());
      for (std::uint32_t i = 0; i <= cells; ++i)
        for (std::uint32_t j = 0; j <= cells; ++j) {
          Vec3d p = centre;
          p[axis] += side * half[axis];
          p[u] += half[u] * (2.0 * i / cells - 1);
          p[v] += half[v] * (2.0 * j / cells - 1);
          vertices.push_back(p);
        }
      for (std::uint32_t i = 0; i < cells; ++i)
        for (std::uint32_t j = 0; j < cells; ++j) {
          const std::uint32_t a = first + i * (cells + 1) + j, b = a + cells + 1, c = b + 1, d = a + 1;
          const bool turns = (side > 0) == inward;
          triangles.push_back(turns ? Triangle{a, c, b} : Triangle{a, b, c});
          triangles.push_back(turns ? Triangle{a, d, c} : Triangle{a, c, d});
        }
    }
  }
};

}  // namespace clearance::test
