// Detects that this process is a fork of the one that made an engine or opened a connection.
//
// Threads, sockets and shared slots belong to that process. A child must neither use nor close them, and must make its
// own.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>

namespace clearance {

/// Identifies the process that constructed it.
class ForkGuard {
 public:
  /// True in a child forked since. Costs a load, without a system call.
  bool forked() const { return generation_ != current_; }

 private:
  // Number of forks between the first process and this one.
  inline static std::atomic<std::uint64_t> current_{0};
  inline static const int registered_ =
      pthread_atfork(nullptr, nullptr, [] { current_.fetch_add(1, std::memory_order_relaxed); });

  std::uint64_t generation_ = current_;
};

}  // namespace clearance
