// A triangle of a list of vertices.
#pragma once

#include <array>
#include <cstdint>

namespace clearance {

/// Indices of its corners, outward by the right-hand rule.
using Triangle = std::array<std::uint32_t, 3>;

}  // namespace clearance
