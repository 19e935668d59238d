// What a query asks, without its configurations: how a query is known again.
#pragma once

#include <vector>

#include "engine/selection/query.h"

namespace clearance {

/// A copy of all that decides about a query's answer but where its configurations put bodies and joints, and the scene.
class QueryKey {
 public:
  explicit QueryKey(const QueryView& query);
  QueryKey(QueryKey&&) = default;
  QueryKey& operator=(QueryKey&&) = default;
  /// Whether `query` asks the same, bit for bit, in as many configurations.
  bool is_of(const QueryView& query) const;

 private:
  QueryView query_;  // its spans point into the members below, or at nothing
  std::vector<BodyPair> pairs_;
  std::vector<std::uint32_t> bodies_, joints_;
  std::vector<MarginEntry> margins_;
  std::vector<double> pair_margins_, weights_;
};

}  // namespace clearance
