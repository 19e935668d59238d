// CoACD, which proposes convex pieces, in a Python process of its own.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"
#include "inspect/decompose.h"

namespace clearance {

struct ProposedPiece {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
};

/// What CoACD makes of a mesh. Nothing of it is believed but that indices are in range. Throws as decompose() does.
std::vector<ProposedPiece> propose_pieces(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                                          const DecomposeOptions& options, const std::atomic<bool>& stop);

}  // namespace clearance
