// The loop's thread at real-time priority, on memory that stays: --real-time. What the kernel refuses is said, and done
// without.
#pragma once

#include <optional>
#include <string>

namespace clearance {

/// SCHED_FIFO's priority: above everything ordinary, below what kernels run their interrupts at (50).
inline constexpr int kRealTimePriority = 20;

// Each does its step, and returns why the kernel refuses; empty: it is done.

/// Keeps every page of this process in memory once it was touched (mlockall), of now and later. Refused where a limit
/// would make later allocations fail.
std::string lock_memory();
/// Touches this thread's stack and as much of the heap as small queries need, so that they meet no page fault.
void prefault();
/// Lets this thread run on one CPU alone.
std::string pin_to(int cpu);
/// SCHED_FIFO for this thread, not for those that it starts.
std::string run_first();

/// Lets this thread, and those that it starts, stand back behind the threads that answer (nice 10).
void run_behind();

/// All of it for the calling thread, said in the log.
void become_real_time(std::optional<int> cpu);

}  // namespace clearance
