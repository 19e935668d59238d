// Round cores as covers need them.
#pragma once

#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/primitive.h"

namespace clearance {

/// Vertices of a polytope around a round core.
std::vector<Vec3d> polytope_around(const Primitive& core);

/// Radius of a ball about `c` in a round core, or a value not above 0.
double in_core(const Primitive& core, const Vec3d& c);

}  // namespace clearance
