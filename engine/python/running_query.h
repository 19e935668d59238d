// Queries of the engine in a Python process, which run in slices.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "client/python/bindings/answer.h"
#include "client/python/bindings/process_guard.h"
#include "client/python/bindings/query.h"
#include "engine/engine.h"
#include "engine/query/job_pool.h"

namespace clearance::python {

using Clock = std::chrono::steady_clock;

inline std::int64_t nanoseconds_since(Clock::time_point begin) {
  return std::chrono::nanoseconds(Clock::now() - begin).count();
}

/// A running query with its columns.
class PyJob {
 public:
  PyJob(std::shared_ptr<engine::Engine> engine, ProcessGuard guard, Job job, Answer answer)
      : engine_(std::move(engine)), guard_(guard), job_(std::move(job)), answer_(std::move(answer)) {}

  /// Works for a time without the interpreter's lock. Returns true once done.
  bool advance(std::int64_t budget_ns);
  /// The same, for a caller that has released the lock.
  /// \param begin of this slice
  bool go_on(std::int64_t budget_ns, Clock::time_point begin = Clock::now());
  /// Returns the answer, once, after the job is done.
  Answer take();

 private:
  std::shared_ptr<engine::Engine> engine_;
  ProcessGuard guard_;
  Job job_;
  Answer answer_;
  std::int64_t ns_ = 0;
};

/// A query whose runs share jobs.
struct RepeatedQuery : Query {
  /// Returns the pool of its jobs, or null for the first run: a call makes a new query, and the engine finds its jobs.
  std::shared_ptr<JobPool> pool() const { return has_run->exchange(true) ? jobs : nullptr; }

  std::shared_ptr<JobPool> jobs = std::make_shared<JobPool>();
  std::shared_ptr<std::atomic<bool>> has_run = std::make_shared<std::atomic<bool>>(false);
};

constexpr std::size_t kMostConfigurations = 0xFFFFFFFF;

QueryView view_of(const Query& q);
/// Throws ValueError for configurations of another shape than the query's.
QueryView view_of(const Query& q, const Configurations& at);

/// Begins a query, for a caller that has released the interpreter's lock.
PyJob begin_query(const std::shared_ptr<engine::Engine>& engine, ProcessGuard guard, const RepeatedQuery& query,
                  const QueryView& view);

}  // namespace clearance::python
