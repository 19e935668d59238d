// Detects that this process is a fork of the one that made an object.
//
// Threads, sockets and shared memory belong to the process that opened them. A child must neither use nor close them.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>

namespace clearance {

/// Identifies the process that constructed it.
class ForkGuard {
 public:
  /// True in a child forked since. Costs a load; getpid() would need a system call each time.
  bool forked() const { return generation_ != generation.load(std::memory_order_relaxed); }

 private:
  // Counts the forks between the first process and this one.
  inline static std::atomic<std::uint64_t> generation{0};
  inline static const int registered =
      pthread_atfork(nullptr, nullptr, [] { generation.fetch_add(1, std::memory_order_relaxed); });

  std::uint64_t generation_ = (static_cast<void>(registered), generation.load(std::memory_order_relaxed));
};

}  // namespace clearance
