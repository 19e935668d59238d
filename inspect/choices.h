// What a mesh that is not convex could be instead, at what cost, and how far off it would be.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/scene/scene.h"
#include "inspect/timing.h"

namespace clearance {

/// One of the things that a body of a mesh may be.
struct Choice {
  std::uint32_t body = kNone;
  Convexify what = Convexify::kHull;
  bool is_now = false;                ///< the body is that
  std::uint64_t vertices = 0;         ///< of its hull
  std::uint64_t triangles = 0;        ///< that answers are about
  std::uint64_t bytes = 0;            ///< the hull, its columns and tables, the triangles and their tree
  double hull_excess = 0;             ///< metres; no point of it is farther from the mesh
  std::uint64_t stand_ins = 0;        ///< convex pieces that answer first for its triangles
  double inner = 0;                   ///< metres; no point of the mesh is farther from these
  std::optional<double> ns_per_pair;  ///< measured; none: not measured, or no partner with a pose
};

/// The hull, the surface and, of a closed mesh, the solid, and with the pieces that it has, for each body of one mesh
/// that is not proved convex; of bodies of the same mesh the first. \param times null: nothing is measured
std::vector<Choice> choices_of(const Scene& scene, const PairTimes* times);

}  // namespace clearance
