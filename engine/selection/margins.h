// Margins: distances that decisions test pairs against.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/scene.h"
#include "engine/selection/query.h"

namespace clearance {

class PairList;

/// Margins of a query's pairs, by position.
class Margins {
 public:
  /// Limits of one query on entries, and on the work of matching them: bodies that they name, and pairs times 64
  /// entries.
  static constexpr std::size_t kMostEntries = 4096;
  static constexpr std::uint64_t kMostWork = std::uint64_t{1} << 22;  // fits into one slice

  Margins() = default;
  /// Throws QueryError for an invalid margin, an unknown body or group, a number of margins other than that of pairs,
  /// and beyond the limits above.
  Margins(const QueryView& query, const engine::Scene& scene, const PairList& pairs);

  double of(std::uint64_t position) const { return each_.empty() ? most_ : each_[position]; }
  std::span<const double> each() const { return each_; }  ///< (P,); empty if all are the same
  double least() const { return least_; }
  double most() const { return most_; }

 private:
  std::vector<double> each_;  // (P,); empty if all are the same
  double least_ = 0, most_ = 0;
};

}  // namespace clearance
