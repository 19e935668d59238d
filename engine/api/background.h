// Queries of Engine::submit(): one thread of an engine answers them in order.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "engine/api/result_memory.h"
#include "engine/query/job.h"
#include "wire/api/prepared.h"

namespace clearance {

/// A job under way, and its result.
class BackgroundJob {
 public:
  BackgroundJob(Job job, std::shared_ptr<const ResultMemory> memory, WhenDone when_done)
      : job_(std::move(job)), memory_(std::move(memory)), when_done_(std::move(when_done)) {}
  /// Works until the result is there, or cancel() is called.
  void run();
  void cancel() { is_cancelled_ = true; }
  bool wait_for(std::chrono::nanoseconds timeout);
  /// Waits for the result. Throws the error of the job.
  Result get();

 private:
  Job job_;
  std::shared_ptr<const ResultMemory> memory_;
  WhenDone when_done_;
  std::atomic<bool> is_cancelled_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_done_ = false;  // guarded by mutex_, as the members below
  std::optional<Result> result_;
  std::exception_ptr error_;
};

/// Starts its thread with the first job. The destructor waits for the running job, which should be cancelled before.
class Background {
 public:
  ~Background();
  void add(std::shared_ptr<BackgroundJob> job);

 private:
  void work();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::shared_ptr<BackgroundJob>> jobs_;  // guarded by mutex_, as the members below
  bool is_closed_ = false;
  std::thread thread_;
};

}  // namespace clearance
