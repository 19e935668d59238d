// How far a robot's links may be from where reals put them, made ready for queries (docs/bounds.md, "Kinematics").
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/placement_error.h"
#include "engine/robot/kinematics.h"

namespace clearance {

/// Of one robot's links, in the frames of the roots that they hang on. Immutable.
class LinkErrors {
 public:
  /// Links with shapes up to which there is a table of their pairs.
  static constexpr std::size_t kMostTabled = 512;

  LinkErrors() = default;
  /// \param radii (links,) metres: no point of a link is farther from its origin; negative: it has no shape
  LinkErrors(const Kinematics& robot, std::span<const double> radii);

  /// Of a link's origin, metres. \param travel Kinematics::travels() of the link
  double shift(std::uint32_t link, double travel) const { return links_[link].at(travel, 0); }
  /// Of a link's axes, radians.
  double turn(std::uint32_t link) const { return links_[link].turn; }
  /// How far the distance of two links with shapes may be off: what the joints between them make. +inf: they hang on
  /// different roots or are too many for a table, and the sum of both links' errors has to do. \param travel the larger
  /// of both
  double between(std::uint32_t a, std::uint32_t b, double travel) const;

  /// What these are made of, for who asks elsewhere than here: of a link's origin, its place in the table of pairs
  /// (kNone: it has no shape), and the table, by link_pair_place(); empty: there is none.
  const PlacementError& origin(std::uint32_t link) const { return links_[link]; }
  std::uint32_t slot(std::uint32_t link) const { return slots_[link]; }
  std::span<const LinkPairError> pairs() const { return pairs_; }

 private:
  std::vector<PlacementError> links_;  // of their origins
  std::vector<std::uint32_t> slots_;   // by link: its place in the table, or kNone
  std::vector<LinkPairError> pairs_;   // of slots, by link_pair_place()
};

}  // namespace clearance
