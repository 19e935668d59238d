// Quaternions that were probably written in the order x, y, z, w.
#pragma once

#include <string>

#include "engine/pose/pose.h"

namespace clearance {

/// A sentence about a pose whose quaternion reads as a half turn here and, in the order x, y, z, w, as no turn or one
/// about z alone; empty for every other. The negated quaternion is the same rotation and is not warned about.
std::string order_warning(const Pose& X);

}  // namespace clearance
