// Exact distances with which the answers of the sweep are compared.
#pragma once

#include <vector>

#include "bench/tradeoff/scenes.h"
#include "engine/narrow/certify.h"

namespace clearance::tradeoff {

/// Intervals that contain the exact distance (0 for overlapping pairs), with a relative width of about 1e-15: by step,
/// then by pair.
struct ExactDistances {
  std::vector<std::vector<Interval>> exact;
  double median = 0;  ///< of the distances of all pairs in all steps, in metres

  std::size_t checked = 0;  ///< pairs also checked by the exact oracle
};

/// Queries the reference backend for every step, and the exact oracle (tests/oracle) for up to `checked` pairs of the
/// first step whose bodies are small enough. Throws std::logic_error if the two contradict each other.
ExactDistances find_exact_distances(const MovingScene& scene, std::size_t checked);

/// Answers of one query, with their memory.
struct Answers {
  std::vector<double> distance, lower, upper;
  std::vector<std::uint8_t> status;

  explicit Answers(std::size_t rows) : distance(rows), lower(rows), upper(rows), status(rows) {}
  ReplyView view();
};

}  // namespace clearance::tradeoff
