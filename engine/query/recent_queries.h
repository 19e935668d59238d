// The last queries of a caller, with their jobs: a query that repeats is fast without being prepared.
#pragma once

#include <cstddef>
#include <list>
#include <memory>

#include "engine/query/job_pool.h"
#include "engine/query/query_key.h"

namespace clearance {

/// Not thread-safe; the pools are.
class RecentQueries {
 public:
  static constexpr std::size_t kQueries = 8;
  static constexpr std::size_t kBodies = 8192;  ///< of the scene, times queries: a job has up to 1 KB for each

  /// \param jobs kept of each query
  explicit RecentQueries(std::size_t jobs) : jobs_(jobs) {}

  /// Most queries whose jobs are kept.
  /// \param bodies number of bodies in the scene
  static std::size_t most(std::size_t bodies);
  /// Returns the pool of a query, which JobPool allows. Evicts the queries that were repeated longest ago.
  /// \param bodies number of bodies in the scene
  std::shared_ptr<JobPool> pool_of(const QueryView& query, std::size_t bodies);

 private:
  struct Kept {
    QueryKey key;
    std::shared_ptr<JobPool> pool;
  };
  std::size_t jobs_;
  std::list<Kept> queries_;  // the last one is at the front
};

}  // namespace clearance
