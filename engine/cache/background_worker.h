// Work on a thread of lowest priority.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

namespace clearance {

/// A result that is made once. Threads may work on it at the same time, and the first result is taken.
class BackgroundTask {
 public:
  using Result = std::shared_ptr<const void>;

  virtual ~BackgroundTask() = default;
  /// Reads the result from the cache, or returns null.
  virtual Result read() const = 0;
  /// Returns null if the result is impossible, or once `stopped` is set.
  virtual Result make(const std::atomic<bool>& stopped) const = 0;
  /// Publishes the result, or null if it is impossible. Called once, by one thread at a time for all tasks of the worker,
  /// whose functions it must not call.
  virtual void take(Result result, std::chrono::nanoseconds took) = 0;

 private:
  friend class BackgroundWorker;
  std::atomic<bool> is_done_{false};
  std::chrono::steady_clock::time_point added_{};
  int makers_ = 0;  // threads at work on it, each of which holds it
};

/// Something, such as an engine, for as long as which results are kept; if null, for ever.
using TaskOwner = std::shared_ptr<const void>;

class TaskOwners {
 public:
  void add(const TaskOwner& owner) {
    std::erase_if(owners_, [](const auto& known) { return known.expired(); });
    if (owner)
      owners_.push_back(owner);
    else
      for_ever_ = true;
  }
  bool are_gone() const {
    return !for_ever_ && std::all_of(owners_.begin(), owners_.end(), [](const auto& known) { return known.expired(); });
  }

 private:
  std::vector<std::weak_ptr<const void>> owners_;
  bool for_ever_ = false;
};

/// Does tasks one by one, in order. Its thread exists only while some are pending. Thread-safe.
class BackgroundWorker {
 public:
  BackgroundWorker();
  /// Stops the thread. Frees nothing in a child after fork(), which has no such thread.
  ~BackgroundWorker();
  BackgroundWorker(const BackgroundWorker&) = delete;
  BackgroundWorker& operator=(const BackgroundWorker&) = delete;

  /// Tasks that nothing else holds any more are dropped before they begin.
  void add(const std::vector<std::shared_ptr<BackgroundTask>>& tasks);
  /// Waits until nothing is pending, and returns whether that is so. Does tasks on the calling thread meanwhile, since a
  /// thread of lowest priority may get no time; so one task may take longer than the timeout.
  bool wait(std::chrono::nanoseconds timeout);
  /// Takes no lock.
  std::uint64_t pending() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
  int process_;
};

}  // namespace clearance
