#include "bench/latency/bench_floor.h"

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

extern char** environ;

namespace clearance::cli {
namespace {

constexpr const char* kReady = "ready ";

/// If the bench was pinned to some CPUs (taskset), the echo runs on the others, as the daemon will.
void take_other_cpus() {
  cpu_set_t ours, others;
  if (::sched_getaffinity(0, sizeof ours, &ours) != 0) return;
  CPU_ZERO(&others);
  const long online = ::sysconf(_SC_NPROCESSORS_ONLN);
  for (long cpu = 0; cpu < std::min<long>(online, CPU_SETSIZE); ++cpu)
    if (!CPU_ISSET(cpu, &ours)) CPU_SET(cpu, &others);
  if (CPU_COUNT(&others) > 0) ::sched_setaffinity(0, sizeof others, &others);  // not an error if not permitted
}

}  // namespace

void request_to_hold(std::byte* request, std::chrono::nanoseconds held) {
  const std::int64_t ns = held.count();
  std::memcpy(request, &ns, sizeof ns);
}

void hold(const std::byte* request) {
  std::int64_t ns = 0;
  std::memcpy(&ns, request, sizeof ns);
  if (ns <= 0) return;
  using Clock = std::chrono::steady_clock;
  for (const auto end = Clock::now() + std::chrono::nanoseconds(ns); Clock::now() < end;) {
  }
}

EchoProcess::EchoProcess(const std::vector<std::string>& arguments, int inherited) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error(std::string("floor: pipe: ") + std::strerror(errno));
  std::vector<std::string> words{"clearance", "bench-echo", std::to_string(::getpid())};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  // Duplicates the descriptor onto itself, which clears close-on-exec for the child only.
  if (inherited >= 0) ::posix_spawn_file_actions_adddup2(&actions, inherited, inherited);
  const int error = ::posix_spawn(&pid_, "/proc/self/exe", &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  if (error != 0) {
    ::close(ends[0]);
    throw std::runtime_error(std::string("floor: cannot start the echo process: ") + std::strerror(error));
  }
  std::string line;
  char byte;
  while (::read(ends[0], &byte, 1) == 1 && byte != '\n') line += byte;
  ::close(ends[0]);
  if (line.rfind(kReady, 0) != 0) {
    int status;
    ::waitpid(pid_, &status, 0);
    throw std::runtime_error("floor: the echo process did not start");
  }
  said_ = line.substr(std::strlen(kReady));
}

EchoProcess::~EchoProcess() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  int status;
  ::waitpid(pid_, &status, 0);
}

bool EchoProcess::alive() {
  int status;
  if (pid_ > 0 && ::waitpid(pid_, &status, WNOHANG) == pid_) pid_ = -1;
  return pid_ > 0;
}

std::unique_ptr<Floor> open_floor(const std::string& url, const EchoSize& size) {
  if (url.rfind("shm://", 0) == 0) return open_shm_floor(url, size);
#ifdef CLEARANCE_HAVE_LCM
  if (url.rfind("udpm://", 0) == 0) return open_lcm_floor(url, size);
#endif
  return open_zmq_floor(url, size);
}

int run_echo(const std::vector<std::string>& arguments) {
  if (arguments.size() < 2) throw std::invalid_argument("bench-echo is started by bench");
  // Ends with the parent even if that was killed before this call.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != std::stoi(arguments[0])) return 1;
  take_other_cpus();
  const std::string& kind = arguments[1];
  const std::vector<std::string> rest(arguments.begin() + 2, arguments.end());
  if (kind == "shm") return run_shm_echo(rest);
  if (kind == "zmq") return run_zmq_echo(rest);
#ifdef CLEARANCE_HAVE_LCM
  if (kind == "lcm") return run_lcm_echo(rest);
#endif
  throw std::invalid_argument("bench-echo: no transport " + kind);
}

}  // namespace clearance::cli
