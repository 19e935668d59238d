// Jobs that have answered, kept for the same question in other configurations.
//
// A planner asks about one configuration a call, thousands of times: the same pairs, the same margins, the same bodies
// around it. Making ready for that takes longer than the answer: the query is checked, its pairs are listed, boxes of
// all bodies are made, and memory for all of it is found. A job that is kept has done so. Asked again it answers other
// configurations on the same snapshot, with the bits that a new one would give: nothing of an answer depends on what
// was answered before (tests/engine/query/test_kept_jobs.cpp).
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/query/job_state.h"

namespace clearance {

/// The jobs of the last questions. Thread-safe; a job has one asker at a time.
class KeptJobs {
 public:
  static constexpr std::size_t kJobs = 8;  ///< of questions that are asked by turns, or by so many threads

  /// \param scene must outlive this.
  explicit KeptJobs(const Scene& scene);

  /// Whether the job of a query may be kept: it is small, and its answer depends on nothing but its question, its
  /// configurations and the snapshot, neither on the clock nor on warm state.
  bool keeps(const QueryView& query) const;
  /// Whether one of so many pair-configurations may, once they are counted.
  static bool keeps(const QuerySize& size);

  /// A job that answered the same question on the same snapshot, with the configurations of `query` as its plan's;
  /// null: there is none. Throws QueryError for configurations that are not as many numbers as the query says.
  Job::StatePtr take(const QueryView& query, const std::shared_ptr<const PoseSnapshot>& snapshot);
  /// Takes a job back whose answer is whole.
  void put_back(std::unique_ptr<Job::State> job);

  std::uint64_t asked_again() const;  ///< how often a job was taken

 private:
  struct Kept {
    std::unique_ptr<Job::State> job;
    std::weak_ptr<const PoseSnapshot> snapshot;  // nobody holds an old one for a job that waits
  };

  bool keeps_any_;
  mutable std::mutex mutex_;
  std::vector<Kept> jobs_;  // the one that came back last at the end
  std::uint64_t asked_again_ = 0;
};

}  // namespace clearance
