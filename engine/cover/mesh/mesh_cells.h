// Convex sets that together hold a mesh or point cloud, a solid's interior included.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/base/vec.h"
#include "engine/bvh/surface.h"

namespace clearance {

/// The body lies in the hulls of these points, each grown by `growth`. Metres, body frame.
struct MeshCells {
  std::vector<std::vector<Vec3d>> points;
  double growth = 0;
};

/// Divides a body's bounding box where the hulls stand out most. Deterministic. Takes time about linear in the number
/// of elements, times the logarithm of `most`.
/// \param most number of cells, at least 1
MeshCells mesh_cells(const Surface& surface, std::size_t most);

}  // namespace clearance
