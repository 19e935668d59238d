// Cache key of a query: every option except the configurations.
#pragma once

#include <vector>

#include "engine/selection/query.h"

namespace clearance {

/// A copy of all inputs of a query's answer except the scene and the configurations' values.
class QueryKey {
 public:
  explicit QueryKey(const QueryView& query);
  QueryKey(QueryKey&&) = default;
  QueryKey& operator=(QueryKey&&) = default;
  /// Whether `query` is the same, bit for bit, with as many configurations.
  bool is_of(const QueryView& query) const;

 private:
  QueryView query_;  // its spans point into the members below, or are empty
  bool has_growths_;
  std::vector<BodyPair> pairs_;
  std::vector<std::uint32_t> bodies_, joints_;
  std::vector<MarginEntry> margins_;
  std::vector<double> pair_margins_, weights_, speed_errors_;
};

}  // namespace clearance
