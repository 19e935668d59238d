// Bounds on the distance of two bodies of which one has a mesh, for joint tables.
#pragma once

#include "engine/mesh_distance/element_search.h"
#include "engine/narrow/part_batch.h"
#include "engine/pose/placed.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Metres; `lower` is not above 0 for bodies that overlap.
struct MeshGap {
  double lower, upper;
};

/// Reuses its memory. Not thread-safe.
class MeshGapSearch {
 public:
  /// \param width of the bounds that suffices, metres
  /// \param most distance beyond which the upper bound is not needed, metres
  MeshGap of(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b, double width,
             double most);

 private:
  // Hulls that are apart guide the search.
  void look_along_hulls(const PoseMatrix& pose_a, const PoseMatrix& pose_b);

  ElementSearch elements_;
};

}  // namespace clearance
