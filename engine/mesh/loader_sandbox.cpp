#include "engine/mesh/loader_sandbox.h"

#include <fcntl.h>
#include <linux/seccomp.h>
#include <seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "engine/base/sanitizers.h"
#include "engine/mesh/mesh_format.h"

namespace clearance {

namespace {

int result_fd_of_handler = -1;

// On the thread that made the call, which the kernel has not carried out. Nothing here takes memory.
void report_forbidden_call(int, siginfo_t* info, void*) {
  char text[160];
  std::snprintf(text, sizeof text,
                "reading it was stopped: the mesh loader asked for system call %d, which no mesh file needs; is the "
                "file hostile?",
                info->si_syscall);
  const bool written = write_mesh_error(result_fd_of_handler, MeshState::kError, text);
  ::_exit(written ? 0 : 4);
}

/// Builds the list of what is allowed; anything else is a trap.
class Filter {
 public:
  Filter() : context_(::seccomp_init(SCMP_ACT_TRAP), &::seccomp_release) {
    if (!context_) throw std::bad_alloc();
    check(::seccomp_attr_set(context_.get(), SCMP_FLTATR_API_SYSRAWRC, 1), "attributes");
  }
  /// \param call may be one that this architecture does not have.
  template <class... Conditions>
  void allow(int call, Conditions... conditions) {
    const scmp_arg_cmp all[sizeof...(conditions) + 1] = {conditions..., {}};
    const int error = ::seccomp_rule_add_array(context_.get(), SCMP_ACT_ALLOW, call, sizeof...(conditions), all);
    if (error != 0 && error != -EDOM) check(error, "rules");
  }
  /// The kernel's error; 0: in force.
  int load() const { return -::seccomp_load(context_.get()); }

 private:
  static void check(int error, const char* what) {
    if (error != 0)
      throw std::runtime_error(std::string("the mesh loader cannot be confined: ") + what + ": " +
                               std::generic_category().message(-error));
  }
  std::unique_ptr<void, decltype(&::seccomp_release)> context_;
};

Filter make_filter() {
  Filter filter;
  // Reading files, and finding out about them. Which ones is the loader's own affair: it opens those of one folder.
  constexpr unsigned kWrites = O_WRONLY | O_RDWR | O_CREAT | O_TRUNC | O_APPEND | (O_TMPFILE & ~O_DIRECTORY);
  filter.allow(SCMP_SYS(openat), SCMP_A2(SCMP_CMP_MASKED_EQ, kWrites, 0));
  filter.allow(SCMP_SYS(open), SCMP_A1(SCMP_CMP_MASKED_EQ, kWrites, 0));
  for (const int call :
       {SCMP_SYS(read),   SCMP_SYS(readv),     SCMP_SYS(pread64),    SCMP_SYS(lseek),     SCMP_SYS(_llseek),
        SCMP_SYS(close),  SCMP_SYS(stat),      SCMP_SYS(stat64),     SCMP_SYS(lstat),     SCMP_SYS(lstat64),
        SCMP_SYS(fstat),  SCMP_SYS(fstat64),   SCMP_SYS(newfstatat), SCMP_SYS(fstatat64), SCMP_SYS(statx),
        SCMP_SYS(access), SCMP_SYS(faccessat), SCMP_SYS(faccessat2), SCMP_SYS(readlink),  SCMP_SYS(readlinkat),
        SCMP_SYS(getcwd)})
    filter.allow(call);
  // The result: descriptors that are open. Those that files have are for reading.
  for (const int call : {SCMP_SYS(write), SCMP_SYS(pwrite64), SCMP_SYS(ftruncate)}) filter.allow(call);
  // Memory, none of which becomes code.
  filter.allow(SCMP_SYS(mmap), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  filter.allow(SCMP_SYS(mmap2), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  filter.allow(SCMP_SYS(mprotect), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  for (const int call : {SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(brk), SCMP_SYS(madvise)}) filter.allow(call);
  // What the C++ library asks for by itself.
  for (const int call :
       {SCMP_SYS(futex), SCMP_SYS(futex_time64), SCMP_SYS(clock_gettime), SCMP_SYS(clock_gettime64),
        SCMP_SYS(gettimeofday), SCMP_SYS(getrandom), SCMP_SYS(sched_yield), SCMP_SYS(getpid), SCMP_SYS(gettid)})
    filter.allow(call);
  // Its end, by abort() too: a crash is told as one.
  for (const int call : {SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn),
                         SCMP_SYS(sigreturn), SCMP_SYS(restart_syscall)})
    filter.allow(call);
  const auto self = static_cast<scmp_datum_t>(::getpid());
  filter.allow(SCMP_SYS(tgkill), SCMP_A0(SCMP_CMP_EQ, self, 0));
  filter.allow(SCMP_SYS(rt_sigaction), SCMP_A0(SCMP_CMP_EQ, SIGABRT, 0));
#if defined(CLEARANCE_ASAN) || defined(CLEARANCE_TSAN)
  // What their own code asks for: whether memory can be read is tried with a pipe.
  for (const int call :
       {SCMP_SYS(pipe), SCMP_SYS(pipe2), SCMP_SYS(sched_getaffinity), SCMP_SYS(sigaltstack), SCMP_SYS(getrusage)})
    filter.allow(call);
#endif
  return filter;
}

}  // namespace

std::string confine_loader(int result_fd) {
  // A question that a kernel with filters answers, and one that has none, or a container that forbids them, does not.
  const std::uint32_t wanted = SECCOMP_RET_TRAP;
  if (::syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &wanted) != 0)
    return "the kernel refuses filters of system calls (" + std::generic_category().message(errno) + ")";
  result_fd_of_handler = result_fd;
  struct sigaction action{};
  action.sa_sigaction = report_forbidden_call;
  action.sa_flags = SA_SIGINFO;
  ::sigfillset(&action.sa_mask);
  if (::sigaction(SIGSYS, &action, nullptr) != 0) throw std::system_error(errno, std::generic_category(), "sigaction");
  const Filter filter = make_filter();
  if (const int error = filter.load(); error != 0)
    throw std::runtime_error("the mesh loader cannot be confined: " + std::generic_category().message(error));
  return "";
}

}  // namespace clearance
