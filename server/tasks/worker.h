// Works on queries on a thread of its own, a slice of each in turn, so that the loop neither computes nor waits for
// others.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "server/base/mailbox.h"
#include "server/tasks/scheduler.h"
#include "wire/shm_os.h"

namespace clearance {

/// Used from the loop's thread.
class Worker {
 public:
  using QueryPtr = Scheduler::QueryPtr;

  struct Options {
    std::chrono::nanoseconds slice = std::chrono::microseconds(200);  ///< of one query, before the others get a turn
    bool own_thread = true;  ///< if false the loop calls work(), so that a test can count slices
    int nice = 0;            ///< added to that of the thread, and of threads that it starts
  };

  /// Throws std::runtime_error without a descriptor or thread.
  /// @param done called on the worker's thread when take() has something
  Worker(const Options& options, std::function<void()> done);
  /// Ends after the current slice.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void add(QueryPtr query);
  /// Takes queries for which the loop must continue, and those no longer needed.
  std::vector<QueryPtr> take();
  bool has_done() const { return !done_.empty(); }
  /// Queries added and not yet taken.
  std::size_t size() const { return with_workers_.size(); }
  /// Calls ScheduledQuery::check_client() for each of them.
  void check_clients();
  /// No later than the first deadline.
  ScheduledQuery::Clock::time_point deadline() const { return deadline_; }
  /// Calls ScheduledQuery::expire() for those whose deadline has passed.
  void expire(ScheduledQuery::Clock::time_point now);
  /// Frees an object that takes long to free. From any thread.
  void drop(std::shared_ptr<void> thing);
  /// Works for about a slice, without a thread of its own. Returns whether there was any work.
  bool work();

 private:
  void serve();
  void wake() noexcept;

  std::function<void()> call_;
  const bool own_thread_;
  const int nice_;
  std::vector<ScheduledQuery*> with_workers_;
  ScheduledQuery::Clock::time_point deadline_ = ScheduledQuery::Clock::time_point::max();
  // Before the queries, whose destructors may drop something.
  Mailbox<std::shared_ptr<void>> dropped_;
  shm::UniqueFd wake_fd_;  // the thread sleeps in it
  Mailbox<QueryPtr> added_, done_;
  std::atomic<bool> ending_{false};
  Scheduler scheduler_;  // of the thread
  std::thread thread_;
};

}  // namespace clearance
