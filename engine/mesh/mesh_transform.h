// Where a node of a mesh file puts its meshes, in float64, and how far that may be from what the file means.
#pragma once

#include "engine/base/vec.h"
#include "engine/mesh/mesh_part.h"

namespace clearance {

/// An affine map and, entry by entry, a bound on what rounding did to it.
struct MeshTransform {
  double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  double error[3][4] = {};

  bool is_identity() const;
  double determinant() const;
  /// This map after `inner`: of a node and its child.
  MeshTransform after(const MeshTransform& inner) const;
  /// Moves a part, adds to its rounding, and turns its faces outward again where the map mirrors. Throws LoadError for
  /// a position that is not finite then.
  void apply(MeshPart* part) const;
};

}  // namespace clearance
