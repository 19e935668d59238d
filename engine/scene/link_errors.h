// Bounds on the rounding errors of a robot's link poses (docs/trust/bounds_robots.md, "Kinematics").
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/placement_error.h"
#include "engine/robot/kinematics.h"

namespace clearance {

/// Errors of one robot's links, in the frames of their roots. Immutable.
class LinkErrors {
 public:
  /// Limit on the links with shapes for a table of their pairs.
  static constexpr std::size_t kMostTabled = 512;

  LinkErrors() = default;
  /// \param radii (links,) bound on the distance of a link's points from its origin, in metres; negative without a
  /// shape
  LinkErrors(const Kinematics& robot, std::span<const double> radii);

  /// Error of a link's origin, in metres.
  /// \param travel Kinematics::travels() of the link
  double shift(std::uint32_t link, double travel) const { return links_[link].at(travel, 0); }
  /// Error of a link's axes, in radians.
  double turn(std::uint32_t link) const { return links_[link].turn; }
  /// Error of the distance of two links with shapes, from the joints between them. It is +inf for links on different
  /// roots, or too many for a table; the sum of both links' errors applies then.
  /// \param travel the larger of both
  double between(std::uint32_t a, std::uint32_t b, double travel) const;

  /// Data for other implementations: of a link's origin, its index in the table of pairs (kNone without a shape), and
  /// the table, by link_pair_place(), which may be empty.
  const PlacementError& origin(std::uint32_t link) const { return links_[link]; }
  std::uint32_t slot(std::uint32_t link) const { return slots_[link]; }
  std::span<const LinkPairError> pairs() const { return pairs_; }

 private:
  std::vector<PlacementError> links_;  // of their origins
  std::vector<std::uint32_t> slots_;   // by link: index in the table, or kNone
  std::vector<LinkPairError> pairs_;   // of slots, by link_pair_place()
};

}  // namespace clearance
