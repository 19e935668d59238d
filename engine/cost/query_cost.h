// Upper bound on the cost of a query, computed before its pairs are listed.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/selection/query.h"
#include "engine/state/pose_store.h"

namespace clearance {

/// Counts that saturate at the largest number.
struct QueryCost {
  std::uint64_t pairs = 0;       ///< pairs of bodies times configurations
  std::uint64_t part_pairs = 0;  ///< part pairs times configurations
  std::uint64_t units = 0;       ///< of work (WorkMeter), if each part pair took one support evaluation
  std::uint64_t links = 0;       ///< links of robots that the query moves, times configurations
  std::uint64_t listed = 0;      ///< listed pairs (none for the scene's table) and bodies in margins
};

/// Counts for selectors, summed over the scene beforehand.
class SceneCost {
 public:
  /// \param scene outlives this.
  explicit SceneCost(const engine::Scene& scene);

  /// Linear in the query's lists of pairs and bodies, and in the scene's bodies if some move. Errors in the query are
  /// not reported here.
  QueryCost of(const QueryView& query, const PoseSnapshot& snapshot) const;

 private:
  struct SelectorCost {  // sums over bodies
    std::uint64_t bodies = 0, parts = 0, units = 0;
    void add(const SelectorCost& other);
  };
  SelectorCost side(std::uint32_t selector) const;
  static void add_pairs(QueryCost& cost, const SelectorCost& a, const SelectorCost& b, bool are_same = false);

  const engine::Scene* scene_;
  std::vector<SelectorCost> bodies_, groups_;
  SelectorCost all_;
};

}  // namespace clearance
