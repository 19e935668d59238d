#include "engine/query/recent_queries.h"

#include <algorithm>

namespace clearance {

std::size_t RecentQueries::most(std::size_t bodies) {
  return std::clamp<std::size_t>(kBodies / std::max<std::size_t>(bodies, 1), 1, kQueries);
}

std::shared_ptr<JobPool> RecentQueries::pool_of(const QueryView& query, std::size_t bodies) {
  const auto found =
      std::find_if(queries_.begin(), queries_.end(), [&](const Kept& kept) { return kept.key.is_of(query); });
  if (found != queries_.end()) {
    queries_.splice(queries_.begin(), queries_, found);
  } else {
    queries_.push_front({QueryKey(query), std::make_shared<JobPool>(jobs_)});
    while (queries_.size() > most(bodies)) queries_.pop_back();
  }
  return queries_.front().pool;
}

}  // namespace clearance
