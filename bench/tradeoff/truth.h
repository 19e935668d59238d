// What the answers of the sweep are held against.
#pragma once

#include <vector>

#include "bench/tradeoff/scenes.h"
#include "engine/narrow/certify.h"

namespace clearance::tradeoff {

/// Intervals that hold the exact distance (0 for overlapping pairs), about 1e-15 of it wide: of each step, of each
/// pair.
struct ExactDistances {
  std::vector<std::vector<Interval>> exact;
  double median = 0;  ///< of the distances of all pairs in all steps, metres

  std::size_t checked = 0;  ///< pairs that went before the exact judge as well
};

/// Asks the reference backend about every step, and the exact judge (tests/oracle) about up to `checked` pairs of the
/// first one whose bodies are small enough for it. Throws std::logic_error where the two contradict each other.
ExactDistances find_exact_distances(const MovingScene& scene, std::size_t checked);

/// Answers of one query, in memory of their own.
struct Answers {
  std::vector<double> distance, lower, upper;
  std::vector<std::uint8_t> status;

  explicit Answers(std::size_t rows) : distance(rows), lower(rows), upper(rows), status(rows) {}
  ReplyView view();
};

}  // namespace clearance::tradeoff
