// A running query, as seen by its caller.
#pragma once

#include <chrono>
#include <memory>

#include "engine/narrow/work_meter.h"
#include "engine/selection/query.h"

namespace clearance {

namespace engine {
class Engine;
}
class JobPool;
class Planner;
struct Plan;

/// A running query. Holds the snapshot that it began with. Its columns belong to the caller and must outlive it.
class Job {
 public:
  Job(Job&&) noexcept;
  Job& operator=(Job&&) noexcept;
  ~Job();

  /// Works for about `budget`, at least on one part pair. Returns true once the answer is complete.
  bool advance(std::chrono::nanoseconds budget = std::chrono::nanoseconds::max()) {
    return advance(WorkBudget{.time = budget});
  }
  /// Works within a number of units. If a part pair may not take as many as it needs, the job makes no progress.
  bool advance(const WorkBudget& budget);
  /// Units of work so far, of all threads.
  std::uint64_t units() const;

  const QuerySize& size() const;
  /// Valid once advance() returned true.
  const ReplyInfo& info() const;
  /// Prepares a complete job for Engine::answer_again(), until when it holds no snapshot. Returns false for one that
  /// cannot answer again.
  bool rest();

  struct State;

 private:
  friend class engine::Engine;
  friend class JobPool;
  friend class PreparedQuery;
  // Puts a state back into its pool (job_pool.h).
  struct LetGo {
    void operator()(State* state) const;
  };
  using StatePtr = std::unique_ptr<State, LetGo>;
  explicit Job(StatePtr state);
  StatePtr state_;
};

/// A query prepared for start(): checked, with a snapshot of the poses and its pairs listed.
class PreparedQuery {
 public:
  PreparedQuery(PreparedQuery&&) noexcept;
  PreparedQuery& operator=(PreparedQuery&&) noexcept;
  ~PreparedQuery();
  /// Lists the pairs of the query. Returns true once it is ready; only then may the functions below be called. Throws
  /// QueryError.
  bool advance(const WorkBudget& budget = {});
  const QuerySize& size() const;
  /// Writes the pairs at [begin, begin + count) of QuerySize::pairs.
  void copy_pairs(std::uint64_t begin, std::uint64_t count, BodyPair* out) const;
  /// Bytes of memory held.
  std::uint64_t bytes() const;
  /// Forces execution on the CPU, if Engine::has_cpu().
  void keep_on_cpu();

 private:
  friend class engine::Engine;
  explicit PreparedQuery(std::unique_ptr<Planner> planner);
  explicit PreparedQuery(Job::StatePtr kept);
  const Plan& plan() const;
  std::unique_ptr<Planner> planner_;
  std::shared_ptr<JobPool> pool_;  // for the job; may be null
  Job::StatePtr kept_;             // instead of a planner, a job of the same query
  bool keep_on_cpu_ = false;
};

}  // namespace clearance
