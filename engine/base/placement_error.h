// How far something that joints place may be off, as a length that grows with how far sliding joints are out and how
// far away the root is (docs/bounds.md, "Kinematics"). For host and device.
#pragma once

#include <cstdint>

#include "engine/base/vec.h"

namespace clearance {

/// Terms of second order, and the rounding of these sums themselves.
inline constexpr double kPlacementSlack = 1 + 0x1p-30;

/// Metres. \param travel of the configuration. \param distance of the root's pose
CLEARANCE_HD inline double placement_error(double fixed, double per_travel, double travel, double per_distance = 0,
                                           double distance = 0) {
  return (fixed + per_travel * travel + per_distance * distance) * kPlacementSlack;
}

/// Of two links of one robot: what the joints between them make.
struct LinkPairError {
  double fixed, per_travel;

  CLEARANCE_HD double at(double travel) const { return placement_error(fixed, per_travel, travel); }
};

/// Where the pair of the i-th and the j-th link is in a table of all pairs, i != j.
CLEARANCE_HD inline std::uint64_t link_pair_place(std::uint32_t i, std::uint32_t j) {
  const std::uint64_t low = i < j ? i : j, high = i < j ? j : i;
  return high * (high - 1) / 2 + low;
}

}  // namespace clearance
