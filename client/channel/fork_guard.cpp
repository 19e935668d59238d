#include "client/channel/fork_guard.h"

#include <pthread.h>

#include <atomic>

namespace clearance {
namespace {

// Counts the forks between the first process and this one. getpid() would need a system call each time.
std::atomic<std::uint64_t> generation{0};

[[maybe_unused]] const int registered =
    pthread_atfork(nullptr, nullptr, [] { generation.fetch_add(1, std::memory_order_relaxed); });

}  // namespace

std::uint64_t ForkGuard::current() {
  return generation.load(std::memory_order_relaxed);
}

}  // namespace clearance
