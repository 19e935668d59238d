// Threads that help with work which its caller can do alone.
#pragma once

#include <atomic>
#include <functional>

namespace clearance {

/// Other threads do a part of some work until the end of the scope. That waits only for helpers that have begun: one
/// that gets no core for milliseconds delays nothing, as it would at the end of an OpenMP team. A forked child has
/// helpers of its own.
class HelpingThreads {
 public:
  /// \param helpers at most; fewer where the system has no more threads, or they help others
  /// \param work called by each helper at the same time; throws nothing
  HelpingThreads(int helpers, std::function<void()> work);
  ~HelpingThreads();
  HelpingThreads(const HelpingThreads&) = delete;
  HelpingThreads& operator=(const HelpingThreads&) = delete;

  class Pool;

 private:
  static Pool& pool();

  const std::function<void()> work_;
  const int helpers_;
  int begun_ = 0;                // helpers; under the pool's lock
  std::atomic<int> working_{0};  // helpers now
};

}  // namespace clearance
