// What decisions about pairs test: how far apart each pair has to be.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/scene.h"
#include "engine/selection/query.h"

namespace clearance {

class PairList;

/// The margins of a query's pairs, by their positions.
class Margins {
 public:
  /// Entries of one query, and what finding each pair's entry may cost: bodies that they name, and pairs times 64
  /// entries.
  static constexpr std::size_t kMostEntries = 4096;
  static constexpr std::uint64_t kMostWork = std::uint64_t{1} << 22;  // a slice must hold it

  Margins() = default;
  /// Throws QueryError for a value that is no margin, an unknown body or group, one margin more or less than pairs, and
  /// more than the limits above.
  Margins(const QueryView& query, const Scene& scene, const PairList& pairs);

  double of(std::uint64_t position) const { return each_.empty() ? most_ : each_[position]; }
  std::span<const double> each() const { return each_; }  ///< (P,); empty: they are all the same
  double least() const { return least_; }
  double most() const { return most_; }

 private:
  std::vector<double> each_;  // (P,); empty: they are all the same
  double least_ = 0, most_ = 0;
};

}  // namespace clearance
