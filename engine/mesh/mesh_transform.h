// Transforms of a mesh file's nodes in float64, with error bounds.
#pragma once

#include "engine/base/vec.h"
#include "engine/mesh/mesh_part.h"

namespace clearance {

/// An affine map with a bound on the rounding error of each entry.
struct MeshTransform {
  double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  double error[3][4] = {};

  bool is_identity() const;
  double determinant() const;
  /// Returns this map after `inner`, as for a node and its child.
  MeshTransform after(const MeshTransform& inner) const;
  /// Transforms a part, adds to its rounding, and flips its faces if the map mirrors. Throws LoadError for a position
  /// that is not finite afterwards.
  void apply(MeshPart* part) const;
};

}  // namespace clearance
