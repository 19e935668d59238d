#include "server/base/real_time.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>
#include <vector>

#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {
namespace {

/// Bytes touched of the stack below the loop's frame, and of the heap.
constexpr std::size_t kPrefaultedStackBytes = 256 << 10, kPrefaultedHeapBytes = std::size_t{32} << 20,
                      kBlockBytes = 64 << 10;
constexpr std::size_t kPage = 4096;
constexpr int kCapIpcLock = 14;  // linux/capability.h

/// Whether this process has a capability.
bool has_capability(int number) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (std::uint64_t bits = 0; word == "CapEff:" && status >> std::hex >> bits) return bits >> number & 1;
  return false;
}

void touch(volatile std::byte* begin, std::size_t bytes) {
  for (std::size_t at = 0; at < bytes; at += kPage) begin[at] = std::byte{1};
}

[[gnu::noinline]] void prefault_stack() {
  volatile std::byte stack[kPrefaultedStackBytes];
  touch(stack, sizeof stack);
}

void log_step(const char* step, const std::string& what, const std::string& rejected) {
  if (rejected.empty())
    log::info("event=real_time step={} text=\"{}\"", step, what);
  else
    log::warn("event=real_time_rejected step={} cause=\"{}\"", step, log_text(rejected));
}

}  // namespace

std::string lock_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  if (limit.rlim_cur != RLIM_INFINITY && !has_capability(kCapIpcLock))
    return "RLIMIT_MEMLOCK is " + std::to_string(limit.rlim_cur) +
           " bytes, and beyond it allocations would fail; LimitMEMLOCK=infinity in the unit, or ulimit -l unlimited";
  // On first touch, since most reserved memory (clients' segments, threads' stacks) is never used.
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return "";
  return std::string("mlockall: ") + std::strerror(errno);
}

void prefault() {
  prefault_stack();
  // In blocks that the C library takes from the heap and keeps.
  std::vector<std::unique_ptr<std::byte[]>> blocks(kPrefaultedHeapBytes / kBlockBytes);
  for (auto& block : blocks) {
    block.reset(new std::byte[kBlockBytes]);
    touch(block.get(), kBlockBytes);
  }
}

std::string pin_to(int cpu) {
  cpu_set_t one;
  CPU_ZERO(&one);
  if (cpu < 0 || cpu >= CPU_SETSIZE) return "there is no CPU " + std::to_string(cpu);
  CPU_SET(static_cast<std::size_t>(cpu), &one);
  if (sched_setaffinity(0, sizeof one, &one) == 0) return "";
  return "CPU " + std::to_string(cpu) + ": " + std::strerror(errno) +
         (errno == EINVAL ? "; this process may not run on it" : "");
}

std::string run_first() {
  const sched_param param{kRealTimePriority};
  if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &param) == 0) return "";
  std::string why = std::string("SCHED_FIFO: ") + std::strerror(errno);
  if (errno == EPERM)
    why += "; it needs LimitRTPRIO=" + std::to_string(kRealTimePriority) +
           " and no RestrictRealtime= in the unit, ulimit -r, or the capability CAP_SYS_NICE; in a container also "
           "cpu.rt_runtime_us";
  return why;
}

void run_behind() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), 10);
}

void become_real_time(std::optional<int> cpu) {
  log_step("lock_memory", "pages stay in memory once they were touched", lock_memory());
  prefault();
  log_step("prefault",
           std::to_string(kPrefaultedStackBytes >> 10) + " KiB of stack and " +
               std::to_string(kPrefaultedHeapBytes >> 20) + " MiB of heap are in memory",
           "");
  if (cpu) log_step("pin", "the loop runs on CPU " + std::to_string(*cpu), pin_to(*cpu));
  log_step("priority", "the loop runs at SCHED_FIFO " + std::to_string(kRealTimePriority) + ", and does not spin",
           run_first());
}

}  // namespace clearance
