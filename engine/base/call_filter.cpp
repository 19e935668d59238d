#include "engine/base/call_filter.h"

#include <linux/seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <new>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "engine/base/sanitizers.h"

namespace clearance {
namespace {

void (*rejection)(int call) = nullptr;

// Runs on the thread that made the call, which the kernel has not executed.
void on_forbidden_call(int, siginfo_t* info, void*) {
  rejection(info->si_syscall);
}

}  // namespace

CallFilter::CallFilter(std::string who)
    : who_(std::move(who)), context_(::seccomp_init(SCMP_ACT_TRAP), &::seccomp_release) {
  if (!context_) throw std::bad_alloc();
  check(::seccomp_attr_set(context_.get(), SCMP_FLTATR_API_SYSRAWRC, 1), "attributes");
  // Memory without execution rights.
  allow(SCMP_SYS(mmap), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  allow(SCMP_SYS(mmap2), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  allow(SCMP_SYS(mprotect), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  allow_each({SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(brk), SCMP_SYS(madvise)});
  // Calls of the C++ library itself.
  allow_each({SCMP_SYS(futex), SCMP_SYS(futex_time64), SCMP_SYS(clock_gettime), SCMP_SYS(clock_gettime64),
              SCMP_SYS(gettimeofday), SCMP_SYS(getrandom), SCMP_SYS(sched_yield), SCMP_SYS(getpid), SCMP_SYS(gettid)});
  // Ending, including by abort(), so that a crash is reported as a crash.
  allow_each({SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn),
              SCMP_SYS(sigreturn), SCMP_SYS(restart_syscall)});
  const auto self = static_cast<scmp_datum_t>(::getpid());
  allow(SCMP_SYS(tgkill), SCMP_A0(SCMP_CMP_EQ, self, 0));
  allow(SCMP_SYS(rt_sigaction), SCMP_A0(SCMP_CMP_EQ, SIGABRT, 0));
#if defined(CLEARANCE_ASAN) || defined(CLEARANCE_TSAN)
  // Calls of the sanitizers, which test with a pipe whether memory is readable.
  allow_each(
      {SCMP_SYS(pipe), SCMP_SYS(pipe2), SCMP_SYS(sched_getaffinity), SCMP_SYS(sigaltstack), SCMP_SYS(getrusage)});
#endif
}

void CallFilter::answer(int call, unsigned short error) {
  add(SCMP_ACT_ERRNO(error), call, 0, nullptr);
}

void CallFilter::add(std::uint32_t action, int call, unsigned count, const scmp_arg_cmp* conditions) {
  const int error = ::seccomp_rule_add_array(context_.get(), action, call, count, conditions);
  if (error != 0 && error != -EDOM) check(error, "rules");
}

void CallFilter::bind_all_threads() {
  check(::seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_TSYNC, 1), "threads");
}

void CallFilter::check(int error, const char* what) const {
  if (error != 0)
    throw std::runtime_error(who_ + " cannot be confined: " + what + ": " + std::generic_category().message(-error));
}

std::string CallFilter::enforce(void (*reject)(int call)) {
  // Fails on a kernel without filters, and in a container that forbids them.
  const std::uint32_t wanted = SECCOMP_RET_TRAP;
  if (::syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &wanted) != 0)
    return "the kernel does not permit filters of system calls (" + std::generic_category().message(errno) + ")";
  rejection = reject;
  struct sigaction action{};
  action.sa_sigaction = on_forbidden_call;
  action.sa_flags = SA_SIGINFO;
  ::sigfillset(&action.sa_mask);
  if (::sigaction(SIGSYS, &action, nullptr) != 0) throw std::system_error(errno, std::generic_category(), "sigaction");
  check(::seccomp_load(context_.get()), "loading");
  return "";
}

}  // namespace clearance
