// How far a robot's links may be from where reals put them, made ready for queries (docs/bounds.md, "Kinematics").
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

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

  /// Of a link's origin, metres. \param travel Kinematics::travel() of the configuration
  double shift(std::uint32_t link, double travel) const { return links_[link].at(travel, 0); }
  /// Of a link's axes, radians.
  double turn(std::uint32_t link) const { return links_[link].turn; }
  /// How far the distance of two links with shapes may be off: what the joints between them make. +inf: they hang on
  /// different roots or are too many for a table, and the sum of both links' errors has to do.
  double between(std::uint32_t a, std::uint32_t b, double travel) const;

 private:
  struct Pair {
    double fixed, per_travel;
  };
  std::vector<PlacementError> links_;  // of their origins
  std::vector<std::uint32_t> slots_;   // by link: its place in the table, or kNone
  std::vector<Pair> pairs_;            // of slots i < j: at j (j - 1) / 2 + i
};

}  // namespace clearance
