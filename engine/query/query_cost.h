// How much a query asks for at most, told before any of its pairs are looked at.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/selection/query.h"
#include "engine/state/pose_store.h"

namespace clearance {

/// All counts stop at the largest number there is.
struct QueryCost {
  std::uint64_t pairs = 0;        ///< pairs of bodies, times configurations
  std::uint64_t piece_pairs = 0;  ///< likewise
  std::uint64_t units = 0;        ///< of work (WorkMeter), if each piece pair took one support
  std::uint64_t links = 0;        ///< of robots whose joints it moves, times configurations
  std::uint64_t listed = 0;       ///< pairs that a list is made of (none for the scene's table), bodies in margins
};

/// Counts what selectors stand for, which it knows of a scene beforehand.
class SceneCost {
 public:
  /// \param scene outlives this.
  explicit SceneCost(const Scene& scene);

  /// Takes as long as the query's lists of pairs and bodies are, and the scene's of bodies where some move. What is
  /// wrong with the query is not said here.
  QueryCost of(const QueryView& query, const PoseSnapshot& snapshot) const;

 private:
  struct Side {  // sums over bodies
    std::uint64_t bodies = 0, pieces = 0, units = 0;
    void add(const Side& other);
  };
  Side side(std::uint32_t selector) const;
  static void add_pairs(QueryCost& extent, const Side& a, const Side& b, bool are_same = false);

  const Scene* scene_;
  std::vector<Side> bodies_, groups_;
  Side all_;
};

}  // namespace clearance
