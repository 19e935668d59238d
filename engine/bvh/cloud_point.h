// A point of a cloud.
#pragma once

#include <array>

namespace clearance {

/// Metres, in the body's frame. Each float32 is exact.
using CloudPoint = std::array<float, 3>;

}  // namespace clearance
