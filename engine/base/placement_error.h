// Bound on the position error of a link placed by joints. It grows with the travel of sliding joints and the distance
// of the root (docs/trust/bounds_robots.md, "Kinematics"). For host and device.
#pragma once

#include <cstdint>

#include "engine/base/vec.h"

namespace clearance {

/// Covers terms of second order and the rounding of these sums.
inline constexpr double kPlacementSlack = 1 + 0x1p-30;

/// Bound on the position error, in metres.
/// \param travel of the configuration
/// \param distance of the root's pose
CLEARANCE_HD inline double placement_error(double fixed, double per_travel, double travel, double per_distance = 0,
                                           double distance = 0) {
  return (fixed + per_travel * travel + per_distance * distance) * kPlacementSlack;
}

/// Relative error of two links of one robot, due to the joints between them.
struct LinkPairError {
  double fixed, per_travel;

  CLEARANCE_HD double at(double travel) const { return placement_error(fixed, per_travel, travel); }
};

/// Index of the pair of links i and j in a table of all pairs, i != j.
CLEARANCE_HD inline std::uint64_t link_pair_place(std::uint32_t i, std::uint32_t j) {
  const std::uint64_t low = i < j ? i : j, high = i < j ? j : i;
  return high * (high - 1) / 2 + low;
}

}  // namespace clearance
