// Quaternions that were probably written in the order x, y, z, w.
#pragma once

#include <string>

#include "engine/pose/pose.h"

namespace clearance {

/// Returns a warning for a quaternion that is a half turn and, in the order x, y, z, w, would be the identity or a turn
/// about z; otherwise an empty text. The negated quaternion is the same rotation, without the warning.
std::string order_warning(const Pose& X);

}  // namespace clearance
