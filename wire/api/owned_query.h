// A query that owns its arrays.
#pragma once

#include <stdexcept>
#include <vector>

#include "wire/api/query.h"

namespace clearance {

/// Not movable, since the views of `query` point into the members.
struct OwnedQuery {
  /// Throws std::invalid_argument for a query with configurations or positions, which each run has its own of.
  explicit OwnedQuery(const Query& original)
      : query(original),
        pairs(original.pairs.begin(), original.pairs.end()),
        bodies(original.bodies.begin(), original.bodies.end()),
        joints(original.joints.begin(), original.joints.end()),
        margins(original.margins.begin(), original.margins.end()),
        pair_margins(original.pair_margins.begin(), original.pair_margins.end()),
        weights(original.weights.begin(), original.weights.end()),
        speed_errors(original.speed_errors.begin(), original.speed_errors.end()) {
    if (!original.configurations.empty() || !original.positions.empty() || !original.growths.empty() ||
        !original.velocities.empty() || !original.twists.empty())
      throw std::invalid_argument(
          "prepare: configurations, positions, growths and velocities are inputs of run(), not of the query");
    query.pairs = pairs;
    query.bodies = bodies;
    query.joints = joints;
    query.margins = margins;
    query.pair_margins = pair_margins;
    query.weights = weights;
    query.speed_errors = speed_errors;
  }
  OwnedQuery(const OwnedQuery&) = delete;
  OwnedQuery& operator=(const OwnedQuery&) = delete;

  Query query;
  std::vector<IdPair> pairs;
  std::vector<std::uint32_t> bodies, joints;
  std::vector<MarginEntry> margins;
  std::vector<double> pair_margins, weights, speed_errors;
};

}  // namespace clearance
