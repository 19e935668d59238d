#include "engine/pose/pose_order.h"

#include <cstdio>

namespace clearance {

std::string order_warning(const Pose& X) {
  if (!(X.qw == 0 && X.qx == 0 && X.qz > 0)) return "";
  char text[400];
  std::snprintf(
      text, sizeof text,
      "the quaternion 0, 0, %.6g, %.6g looks like one in the order x, y, z, w, which would be %s; in the order "
      "w, x, y, z, which counts, it is a half turn. If that is meant, write the same rotation as 0, 0, %.6g, "
      "%.6g",
      X.qy, X.qz, X.qy == 0 ? "no turn" : "a turn about z", X.qy == 0 ? 0.0 : -X.qy, -X.qz);
  return text;
}

}  // namespace clearance
