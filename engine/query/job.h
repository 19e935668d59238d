// A query under way, as its caller sees it.
#pragma once

#include <chrono>
#include <memory>

#include "engine/narrow/work_meter.h"
#include "engine/selection/query.h"

namespace clearance {

class Engine;
class Planner;
struct Plan;

/// A query under way. Holds the snapshot it began with; the columns it writes belong to the caller and must outlive it.
class Job {
 public:
  Job(Job&&) noexcept;
  Job& operator=(Job&&) noexcept;
  ~Job();

  /// Works for about `budget` (on one pair of pieces at least). Returns true once the answer is whole.
  bool advance(std::chrono::nanoseconds budget = std::chrono::nanoseconds::max()) {
    return advance(WorkBudget{.time = budget});
  }
  /// The same within a number of units. Where one pair may not take as many as it needs, nothing comes of it.
  bool advance(const WorkBudget& budget);
  /// Units of work so far, all threads'.
  std::uint64_t units() const;

  const QuerySize& size() const;
  /// Valid once advance() returned true.
  const ReplyInfo& info() const;

  struct State;

 private:
  friend class Engine;
  friend class KeptJobs;
  friend class PreparedQuery;
  // A state that may be asked again goes back to where such are kept (kept_jobs.h).
  struct LetGo {
    void operator()(State* state) const;
  };
  using StatePtr = std::unique_ptr<State, LetGo>;
  explicit Job(StatePtr state);
  StatePtr state_;
};

/// A query made ready for start(): checked, with one snapshot of the poses, its pairs listed and counted.
class PreparedQuery {
 public:
  PreparedQuery(PreparedQuery&&) noexcept;
  PreparedQuery& operator=(PreparedQuery&&) noexcept;
  ~PreparedQuery();
  /// Lists the pairs that the query names, for about so long. Returns true once it is ready, from when on the rest may
  /// be called. Throws QueryError.
  bool advance(const WorkBudget& budget = {});
  const QuerySize& size() const;
  /// Writes the pairs at [begin, begin + count) of QuerySize::pairs.
  void copy_pairs(std::uint64_t begin, std::uint64_t count, BodyPair* out) const;
  /// Bytes that it holds.
  std::uint64_t bytes() const;
  /// Leaves warm state out: QueryView::warm_slot = 0.
  void begin_cold();
  /// Has no device asked. Where Engine::has_cpu().
  void keep_on_cpu();

 private:
  friend class Engine;
  explicit PreparedQuery(std::unique_ptr<Planner> planner);
  explicit PreparedQuery(Job::StatePtr again);
  const Plan& plan() const;
  std::unique_ptr<Planner> planner_;
  Job::StatePtr again_;  // in place of a planner: a job that has answered the same question before
  bool keep_on_cpu_ = false;
};

}  // namespace clearance
