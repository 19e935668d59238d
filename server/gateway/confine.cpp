#include "server/gateway/confine.h"

#include <fcntl.h>
#include <malloc.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "engine/base/call_filter.h"
#include "engine/base/sanitizers.h"
#include "server/gateway/link.h"
#include "wire/shm_os.h"

namespace clearance::gateway {
namespace {

constexpr int kExitForbidden = 5;

void limit(int resource, std::uint64_t value) {
  const rlimit both{value, value};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &both);
}

[[noreturn]] void end_at_forbidden_call(int call) {
  char text[80];
  const int size = std::snprintf(text, sizeof text, "it made system call %d, which it does not need", call);
  send_failed(kLinkFd, {text, static_cast<std::size_t>(size)});
  ::_exit(kExitForbidden);
}

constexpr unsigned kWrites = O_WRONLY | O_RDWR | O_CREAT | O_TRUNC | O_APPEND | (O_TMPFILE & ~O_DIRECTORY);

/// Calls allowed for both kinds of gateway.
CallFilter make_filter() {
  CallFilter filter("the gateway process");
  filter.allow_each({SCMP_SYS(read),         SCMP_SYS(readv),      SCMP_SYS(write),       SCMP_SYS(writev),
                     SCMP_SYS(recvfrom),     SCMP_SYS(recv),       SCMP_SYS(recvmsg),     SCMP_SYS(sendto),
                     SCMP_SYS(send),         SCMP_SYS(shutdown),   SCMP_SYS(poll),        SCMP_SYS(ppoll),
                     SCMP_SYS(ppoll_time64), SCMP_SYS(epoll_wait), SCMP_SYS(epoll_pwait), SCMP_SYS(epoll_ctl),
                     SCMP_SYS(close),        SCMP_SYS(getsockopt), SCMP_SYS(setsockopt),  SCMP_SYS(getsockname),
                     SCMP_SYS(getpeername),  SCMP_SYS(fstat),      SCMP_SYS(newfstatat),  SCMP_SYS(clock_nanosleep),
                     SCMP_SYS(nanosleep)});
  // For libsodium's keys, and for new threads of libzmq and liblcm.
  filter.allow_each({SCMP_SYS(mlock), SCMP_SYS(munlock), SCMP_SYS(set_robust_list), SCMP_SYS(rseq)});
  filter.allow_each({SCMP_SYS(sched_getparam), SCMP_SYS(sched_getscheduler)});
  filter.allow(SCMP_SYS(sched_setscheduler), SCMP_A1(SCMP_CMP_EQ, SCHED_OTHER, 0));
  filter.allow(SCMP_SYS(prctl), SCMP_A0(SCMP_CMP_EQ, PR_SET_NAME, 0));
  for (const unsigned command : {F_GETFD, F_SETFD, F_GETFL, F_SETFL}) {
    filter.allow(SCMP_SYS(fcntl), SCMP_A1(SCMP_CMP_EQ, command, 0));
    filter.allow(SCMP_SYS(fcntl64), SCMP_A1(SCMP_CMP_EQ, command, 0));
  }
#ifdef CLEARANCE_TSAN  // its runtime reads files to find suppressed races of libzmq
  filter.allow(SCMP_SYS(open), SCMP_A1(SCMP_CMP_MASKED_EQ, kWrites, 0));
  filter.allow(SCMP_SYS(openat), SCMP_A2(SCMP_CMP_MASKED_EQ, kWrites, 0));
  filter.allow_each({SCMP_SYS(readlink), SCMP_SYS(lseek)});
#endif
  return filter;
}

}  // namespace

void limit_gateway([[maybe_unused]] std::uint64_t memory_bytes, std::uint64_t descriptors) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  // A gateway gets neither the priority nor the CPU of the daemon.
  const sched_param ordinary{};
  ::sched_setscheduler(0, SCHED_OTHER, &ordinary);
  cpu_set_t all;
  std::memset(&all, 0xff, sizeof all);
  ::sched_setaffinity(0, sizeof all, &all);
#if !defined(CLEARANCE_ASAN) && !defined(CLEARANCE_TSAN)
  limit(RLIMIT_AS, memory_bytes);  // sanitizers map terabytes of shadow
#endif
  limit(RLIMIT_NOFILE, descriptors);
  limit(RLIMIT_CORE, 0);
#ifdef __GLIBC__
  // Otherwise each thread reserves 64 MB, and reads the number of CPUs from the file system.
  ::mallopt(M_ARENA_MAX, 1);
  ::mallopt(M_MMAP_THRESHOLD, 1 << 20);
#endif
  const shm::UniqueFd first_to_go(::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC));
  [[maybe_unused]] const auto written = ::write(first_to_go.get(), "1000", 4);
}

std::string confine_to_connections() {
  CallFilter filter = make_filter();
  filter.bind_all_threads();
  filter.allow(SCMP_SYS(accept4), SCMP_A0(SCMP_CMP_EQ, kListenerFd, 0));
  return filter.enforce(end_at_forbidden_call);
}

std::string confine_to_datagrams() {
  CallFilter filter = make_filter();
  filter.allow(SCMP_SYS(sendmsg), SCMP_A0(SCMP_CMP_NE, kLinkFd, 0));  // messages to the daemon carry no descriptors
  constexpr unsigned kTypes = ~unsigned(SOCK_CLOEXEC | SOCK_NONBLOCK);
  filter.allow(SCMP_SYS(socket), SCMP_A0(SCMP_CMP_EQ, AF_INET, 0), SCMP_A1(SCMP_CMP_MASKED_EQ, kTypes, SOCK_DGRAM));
  filter.allow_each({SCMP_SYS(bind), SCMP_SYS(connect), SCMP_SYS(pipe), SCMP_SYS(pipe2), SCMP_SYS(select),
                     SCMP_SYS(pselect6), SCMP_SYS(_newselect), SCMP_SYS(rt_sigaction), SCMP_SYS(sched_getaffinity)});
  // Files in /proc and /sys that liblcm and glib read.
  filter.allow(SCMP_SYS(openat), SCMP_A2(SCMP_CMP_MASKED_EQ, kWrites, 0));
  // Threads. A filter cannot see the flags of clone3(), without which the C library falls back to clone().
  filter.allow(SCMP_SYS(clone), SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD));
  filter.answer(SCMP_SYS(clone3), ENOSYS);
  return filter.enforce(end_at_forbidden_call);
}

}  // namespace clearance::gateway
