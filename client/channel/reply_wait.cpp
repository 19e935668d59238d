#include "client/channel/reply_wait.h"

#include <algorithm>
#include <thread>

#include "wire/shm_os.h"

namespace clearance {

namespace {

using namespace std::chrono_literals;

/// Interval between reads of the socket while waiting, and so the maximum delay to detect a daemon's death.
constexpr std::chrono::nanoseconds kNap = 10ms;
constexpr int kSpinsPerClockLook = 16;
/// Part of a long spin after which it checks whether another thread needs the core.
constexpr std::chrono::nanoseconds kSpinSlice = 50us;

}  // namespace

// On one CPU, spinning would block the daemon.
ReplyWait::ReplyWait(std::chrono::nanoseconds spin) : spins_(std::thread::hardware_concurrency() == 1 ? 0ns : spin) {}

Deadline ReplyWait::look() {
  return last_look_ = Deadline::clock::now();
}

bool ReplyWait::wait(ClientSegment& segment, std::uint64_t request_bytes, Deadline deadline) {
  const auto spin = spins_.next(request_bytes);
  if (spin > 0ns) {
    const Deadline end = std::min<Deadline>(last_look_ + spin, deadline);
    const bool arrived = spins_.is_long(spin) ? spin_long(segment, end) : spin_until(segment, end);
    spins_.spun(spin, arrived);
    if (arrived) return false;
  }
  segment.sleep(std::min<std::chrono::nanoseconds>(kNap, deadline - last_look_));
  look();
  return segment.nothing_new();
}

// Returns whether a new entry arrived before `end`.
bool ReplyWait::spin_until(ClientSegment& segment, Deadline end) {
  do {
    for (int i = 0; i < kSpinsPerClockLook; ++i) {
      if (!segment.nothing_new()) return true;
      shm::cpu_relax();
    }
  } while (look() < end);
  return false;
}

// As spin_until(), but ends early if another thread needed this core.
bool ReplyWait::spin_long(ClientSegment& segment, Deadline end) {
  const long before = shm::preemptions();
  bool arrived = false;
  while (!arrived && last_look_ < end) {
    arrived = spin_until(segment, std::min(end, last_look_ + kSpinSlice));
    if (shm::preemptions() == before) continue;
    spins_.preempted();
    break;
  }
  return arrived;
}

}  // namespace clearance
