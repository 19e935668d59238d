// Complete jobs of one query, which answer it again in other configurations.
//
// A motion planner queries one configuration per call, thousands of times, with the same pairs, margins and surrounding
// bodies. Preparation takes longer than the answer: checking the query, listing its pairs, and making boxes of all
// bodies. A job has done all that, and answers other configurations on the same snapshot bit for bit as a new one
// would: no answer depends on earlier ones (tests/engine/query/test_job_pool.cpp).
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/query/job_state.h"

namespace clearance {

/// Belongs to a prepared query: its queries differ in their configurations alone. Thread-safe; a job has one user at a
/// time. May outlive the engine. Shared with its jobs while they run.
class JobPool {
 public:
  /// Pair-configurations of a small job.
  static constexpr std::uint64_t kSmall = 4096;
  /// Pair-configurations of the jobs kept, on average at most. A job has memory for a block of them alone: 0.3 to
  /// 0.6 MB for 60 states of a UR5 among obstacles, up to 160 bytes for each where all are near.
  static constexpr std::uint64_t kShare = 16384;

  /// \param most jobs kept: of concurrent runs, and of different numbers of configurations
  explicit JobPool(std::size_t most = 8) : most_(most) {}

  /// Whether jobs may be kept: they are small, and their answers depend only on the query and the snapshot, but not on
  /// the clock.
  static bool allows(const engine::Scene& scene);
  static bool allows(const QueryView& query);
  /// The same of a job.
  /// \param most pair-configurations
  static bool allows(const QuerySize& size, std::uint64_t most = kSmall);
  /// Pair-configurations of all jobs kept.
  std::uint64_t most_rows() const { return most_ * kShare; }

  /// A job of as many configurations on the same snapshot, with the configurations of `query`, or null. It returns to
  /// its Job::State::pool. Throws QueryError for configurations that do not fit the query's bodies and joints.
  /// \param snapshot moved into the job, if there is one
  Job::StatePtr take(const QueryView& query, std::shared_ptr<const PoseSnapshot>& snapshot);
  /// Whether take() has a job for as many configurations on this snapshot, so that the query was found valid there.
  bool has(std::uint32_t configurations, const std::shared_ptr<const PoseSnapshot>& snapshot) const;
  /// Puts back a job whose answer is complete.
  void put_back(std::unique_ptr<Job::State> job);
  /// Keeps a complete plan without configurations, for the first job.
  void keep_plan(std::unique_ptr<Planner> planner);
  /// That plan, if it is of as many configurations on the same snapshot, with those of `query`, or null. Throws as
  /// take().
  std::unique_ptr<Planner> take_plan(const QueryView& query, const std::shared_ptr<const PoseSnapshot>& snapshot);

 private:
  using Jobs = std::vector<std::unique_ptr<Job::State>>;
  Jobs::const_reverse_iterator find(std::uint32_t configurations,
                                    const std::shared_ptr<const PoseSnapshot>& snapshot) const;

  std::size_t most_;
  mutable std::mutex mutex_;
  Jobs jobs_;                         // the last one put back is at the end
  std::unique_ptr<Planner> planned_;  // without its snapshot
  std::weak_ptr<const PoseSnapshot> planned_for_;
};

}  // namespace clearance
