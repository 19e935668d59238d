// Real-time priority and locked memory for the loop's thread (--real-time). Failed steps are logged and skipped.
#pragma once

#include <optional>
#include <string>

namespace clearance {

/// Priority for SCHED_FIFO: above all ordinary threads, below the kernel's interrupts (50).
inline constexpr int kRealTimePriority = 20;

// Each returns the kernel's reason for a failure, or an empty string.

/// Keeps every touched page of this process in memory, now and later (mlockall). Fails where a limit would make later
/// allocations fail.
std::string lock_memory();
/// Touches this thread's stack and as much of the heap as small queries need, to avoid page faults later.
void prefault();
/// Pins this thread to one CPU.
std::string pin_to(int cpu);
/// Sets SCHED_FIFO for this thread, but not for threads that it starts.
std::string run_first();

/// Lowers the priority of this thread and of those that it starts below that of threads that answer (nice 10).
void run_behind();

/// Does all of it for the calling thread, and logs it.
void become_real_time(std::optional<int> cpu);

}  // namespace clearance
