// CoACD in a separate Python process, which proposes convex parts.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"
#include "inspect/decompose.h"

namespace clearance {

struct ProposedPart {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
};

/// Returns CoACD's convex parts of a mesh. Only their indices are checked. Throws as decompose() does.
std::vector<ProposedPart> propose_parts(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                                        const DecomposeOptions& options, const std::atomic<bool>& stop);

}  // namespace clearance
