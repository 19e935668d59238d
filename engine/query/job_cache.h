// Finished jobs, kept for the same query in other configurations.
//
// A motion planner queries one configuration per call, thousands of times, with the same pairs, margins and surrounding
// bodies. Preparation takes longer than the answer: checking the query, listing its pairs, and making boxes of all
// bodies. A kept job has done all that, and answers other configurations on the same snapshot bit for bit as a new one
// would: no answer depends on earlier ones (tests/engine/query/test_job_cache.cpp).
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/query/job_state.h"

namespace clearance {

/// Jobs of the last queries. Thread-safe; a job has one user at a time.
class JobCache {
 public:
  static constexpr std::size_t kJobs = 8;  ///< for as many alternating queries or threads

  /// \param scene must outlive this
  explicit JobCache(const engine::Scene& scene);

  /// Whether the job of a query may be kept: it is small, and its answer depends only on its key, its configurations
  /// and the snapshot, but not on the clock.
  bool keeps(const QueryView& query) const;
  /// Whether a query of this size may be kept, once its pairs are counted.
  static bool keeps(const QuerySize& size);

  /// A job of the same query on the same snapshot, with the configurations of `query`, or null. Throws QueryError for a
  /// number of configurations other than the query's.
  Job::StatePtr take(const QueryView& query, const std::shared_ptr<const PoseSnapshot>& snapshot);
  /// Puts back a job whose answer is complete.
  void put_back(std::unique_ptr<Job::State> job);

  std::uint64_t cache_hits() const;  ///< number of jobs taken

 private:
  struct Kept {
    std::unique_ptr<Job::State> job;
    std::weak_ptr<const PoseSnapshot> snapshot;  // weak, so that a waiting job keeps no old snapshot alive
  };

  bool keeps_any_;
  mutable std::mutex mutex_;
  std::vector<Kept> jobs_;  // the last one put back is at the end
  std::uint64_t requested_again_ = 0;
};

}  // namespace clearance
