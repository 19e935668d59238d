// Works on queries beside the loop: on a thread of its own, one query after another for a slice each, so that the loop
// neither computes nor leads or waits for those who do.
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
    bool own_thread = true;  ///< false: the loop calls work(), so that a test can count slices
    int nice = 0;            ///< added to the thread's, and so to those of the threads that it leads
  };

  /// \param done called on the worker's thread when take() has something. Throws std::runtime_error where the system
  /// has no descriptor or thread for it.
  Worker(const Options& options, std::function<void()> done);
  /// Ends after the slice that is being worked on.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void add(QueryPtr query);
  /// Those that have come to where the loop is needed, or that nobody wants any more.
  std::vector<QueryPtr> take();
  bool has_done() const { return !done_.empty(); }
  /// Queries that were added and not yet taken.
  std::size_t size() const { return away_.size(); }
  /// Has each of them looked at: ScheduledQuery::look().
  void look();
  /// The first of theirs, or an earlier time.
  ScheduledQuery::Clock::time_point deadline() const { return deadline_; }
  /// Has those whose deadline has passed refused: ScheduledQuery::expire().
  void expire(ScheduledQuery::Clock::time_point now);
  /// Lets go of what takes long to free. From any thread.
  void drop(std::shared_ptr<void> thing);
  /// Works for about a slice, without a thread of its own. Returns whether there was anything to do.
  bool work();

 private:
  void serve();
  void wake() noexcept;

  std::function<void()> call_;
  const bool own_thread_;
  const int nice_;
  std::vector<ScheduledQuery*> away_;
  ScheduledQuery::Clock::time_point deadline_ = ScheduledQuery::Clock::time_point::max();
  // Before the queries: one that ends may drop something.
  Mailbox<std::shared_ptr<void>> dropped_;
  shm::UniqueFd wake_fd_;  // what the thread sleeps in
  Mailbox<QueryPtr> added_, done_;
  std::atomic<bool> ending_{false};
  Scheduler scheduler_;  // the thread's
  std::thread thread_;
};

}  // namespace clearance
