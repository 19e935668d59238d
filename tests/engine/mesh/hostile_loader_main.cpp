// A mesh loader compromised by a file: instead of reading a mesh it runs the attack that the file names in one word, in
// a process with a real loader's limits. If the attack succeeds, its "error" reports that.
#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/io_uring.h>
#include <netinet/in.h>
#include <seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <string>

#include "engine/mesh/loader/loader_process.h"
#include "engine/mesh/mesh_format.h"

namespace {

/// The attacks. Each gets the file `path`, and returns a number below 0 if it failed.
const std::map<std::string, std::function<long(const std::string& path)>> kAttempts = {
    {"nothing", [](const std::string&) { return 0; }},
    {"read_the_file", [](const std::string& path) { return ::open(path.c_str(), O_RDONLY); }},
    {"take_memory", [](const std::string&) { return std::malloc(64 << 20) ? 0 : -1; }},
    {"open_a_network_socket", [](const std::string&) { return ::socket(AF_INET, SOCK_DGRAM, 0); }},
    {"open_a_unix_socket", [](const std::string&) { return ::socket(AF_UNIX, SOCK_STREAM, 0); }},
    {"run_a_program",
     [](const std::string&) {
       // On success nothing returns, so the program itself reports it.
       char* const arguments[] = {const_cast<char*>("sh"), const_cast<char*>("-c"), const_cast<char*>("kill -USR1 $$"),
                                  nullptr};
       return ::execv("/bin/sh", arguments);
     }},
    {"fork",
     [](const std::string&) {
       const pid_t child = ::fork();
       if (child == 0) ::_exit(0);
       ::waitpid(child, nullptr, 0);
       return child;
     }},
    {"create_a_file",
     [](const std::string& path) { return ::open((path + ".new").c_str(), O_WRONLY | O_CREAT, 0600); }},
    {"open_for_writing", [](const std::string& path) { return ::open(path.c_str(), O_RDWR); }},
    {"append", [](const std::string& path) { return ::open(path.c_str(), O_WRONLY | O_APPEND); }},
    {"open_by_the_newest_way",
     [](const std::string& path) {
       const std::uint64_t how[3] = {O_RDWR, 0, 0};
       return ::syscall(SYS_openat2, AT_FDCWD, path.c_str(), how, sizeof how);
     }},
    {"remove_a_file", [](const std::string& path) { return ::unlink(path.c_str()); }},
    {"rename_a_file", [](const std::string& path) { return ::rename(path.c_str(), (path + ".gone").c_str()); }},
    {"link_a_file", [](const std::string& path) { return ::symlink("/etc/passwd", (path + ".link").c_str()); }},
    {"change_rights", [](const std::string& path) { return ::chmod(path.c_str(), 0777); }},
    {"signal_the_parent", [](const std::string&) { return ::kill(::getppid(), SIGURG); }},
    {"signal_the_parents_thread",
     [](const std::string&) { return ::syscall(SYS_tgkill, ::getppid(), ::getppid(), SIGURG); }},
    {"trace_the_parent", [](const std::string&) { return ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr); }},
    {"read_the_parents_memory",
     [](const std::string&) {
       char byte;
       iovec here{&byte, 1}, there{&byte, 1};
       ::process_vm_readv(::getppid(), &here, 1, &there, 1, 0);
       return 0;  // whether there is anything to read does not matter
     }},
    {"make_code_from_data",
     [](const std::string&) {
       return ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) ==
                      MAP_FAILED
                  ? -1
                  : 0;
     }},
    {"make_memory_executable",
     [](const std::string&) {
       void* page = ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
       return ::mprotect(page, 4096, PROT_READ | PROT_EXEC);
     }},
    {"make_another_memory_file", [](const std::string&) { return ::syscall(SYS_memfd_create, "x", 0); }},
    {"ask_the_kernel_by_a_ring",
     [](const std::string&) {
       io_uring_params parameters{};
       ::syscall(SYS_io_uring_setup, 1, &parameters);
       return 0;  // some machines lack it; the call alone is an offence
     }},
    {"catch_the_end",
     [](const std::string&) {
       struct sigaction ignore{};
       ignore.sa_handler = SIG_IGN;
       return ::sigaction(SIGSYS, &ignore, nullptr);
     }},
    {"sleep", [](const std::string&) { return ::usleep(1); }},
};

bool attempt(const std::string& path, std::string_view, std::uint64_t, int result_fd, bool) {
  std::ifstream file(path);
  std::string what;
  file >> what;
  const auto found = kAttempts.find(what);
  if (found == kAttempts.end())
    return clearance::write_mesh_error(result_fd, clearance::MeshState::kError, "unknown attempt");
  errno = 0;
  const long result = found->second(path);
  const std::string text = result >= 0 ? "done" : std::string("failed: ") + std::strerror(errno);
  return clearance::write_mesh_error(result_fd, clearance::MeshState::kError, text.c_str());
}

/// From here on the kernel rejects filters, as in some containers.
void reject_filters() {
  const scmp_filter_ctx filter = ::seccomp_init(SCMP_ACT_ALLOW);
  ::seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(seccomp), 0);
  ::seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(prctl), 1, SCMP_A0(SCMP_CMP_EQ, PR_SET_SECCOMP));
  if (::seccomp_load(filter) != 0) ::_exit(5);
  ::seccomp_release(filter);
}

}  // namespace

int main(int argc, char** argv) {
  // Without the limits each attack succeeds, which proves that the filter stops it.
  if (std::getenv("CLEARANCE_TEST_UNCONFINED") && argc > 1)
    return attempt(argv[1], "", 0, clearance::kMeshResultFd, false) ? 0 : 3;
  if (std::getenv("CLEARANCE_TEST_REFUSE_FILTERS")) reject_filters();
  return clearance::loader_main(argc, argv, attempt);
}
