// Alternative models of a non-convex mesh with their cost and error.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/scene/scene.h"
#include "inspect/timing.h"

namespace clearance {

/// A possible model of a mesh body.
struct Choice {
  std::uint32_t body = kNone;
  MeshAs what = MeshAs::kHull;
  bool is_now = false;                ///< the current model
  std::uint64_t vertices = 0;         ///< of its hull
  std::uint64_t triangles = 0;        ///< of the exact geometry
  std::uint64_t bytes = 0;            ///< the hull, its columns and tables, the triangles and their tree
  double hull_excess = 0;             ///< bound on the hull's distance from the mesh, metres
  std::optional<double> ns_per_pair;  ///< none if not measured, or without a partner that has a pose
};

/// Returns hull, surface, parts and, for a closed mesh, solid of each body of one mesh that is not proved convex.
/// Bodies of the same mesh are listed once.
/// \param times measures; null for no measurements
std::vector<Choice> choices_of(const engine::Scene& scene, const PairTimes* times);

}  // namespace clearance
