// Errors for handles that are used after a fork.
#pragma once

#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace clearance::python {

/// Counts the forks between the first process and this one. getpid() would need a system call each time.
inline std::atomic<std::uint64_t> fork_count{0};
inline const int fork_counter = pthread_atfork(nullptr, nullptr, [] { fork_count.fetch_add(1); });

/// A handle is valid only in the process that created it, since threads and locks do not survive a fork.
class ProcessGuard {
 public:
  void check(const char* what) const {
    if (fork_count.load(std::memory_order_relaxed) == count_) return;
    throw std::runtime_error(std::string(what) + " was made by process " + std::to_string(pid_) +
                             " and cannot be used after a fork; make a new one in the child");
  }

 private:
  std::uint64_t count_ = fork_count.load(std::memory_order_relaxed);
  pid_t pid_ = ::getpid();
};

}  // namespace clearance::python
