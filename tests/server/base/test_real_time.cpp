// --real-time: the effect of each step, and the messages if the kernel rejects it.
#include <grp.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "client/client.h"
#include "server/base/real_time.h"
#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

/// Result of `work` in a child process, which may change its own limits and rights.
std::string in_child(const std::function<std::string()>& work) {
  int ends[2];
  if (pipe(ends) != 0) return "no pipe";
  const pid_t child = fork();
  if (child == 0) {
    const std::string said = work();
    _exit(write(ends[1], said.data(), said.size()) == static_cast<ssize_t>(said.size()) ? 0 : 1);
  }
  close(ends[1]);
  std::string said;
  char part[512];
  for (ssize_t got; (got = read(ends[0], part, sizeof part)) > 0;) said.append(part, static_cast<std::size_t>(got));
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  return said;
}

/// Drops root's privileges and lowers the limits.
void become_nobody() {
  const rlimit none{0, 0}, little{64 << 10, 64 << 10};
  setrlimit(RLIMIT_RTPRIO, &none);
  setrlimit(RLIMIT_MEMLOCK, &little);
  if (geteuid() == 0 && (setgroups(0, nullptr) != 0 || setgid(65534) != 0 || setuid(65534) != 0)) _exit(2);
}

TEST(RealTime, WithoutTheRightEachStepSaysWhatItLacks) {
  const std::string priority = in_child([] {
    become_nobody();
    return run_first();
  });
  EXPECT_NE(priority.find("SCHED_FIFO: Operation not permitted; it needs LimitRTPRIO=20"), std::string::npos)
      << priority;
  EXPECT_EQ(
      in_child([] {
        become_nobody();
        return lock_memory();
      }),
      "RLIMIT_MEMLOCK is 65536 bytes, and beyond it allocations would fail; LimitMEMLOCK=infinity in the unit, or "
      "ulimit -l unlimited");
  EXPECT_EQ(pin_to(-1), "there is no CPU -1");
  EXPECT_NE(pin_to(CPU_SETSIZE - 1).find("this process may not run on it"), std::string::npos);
}

TEST(RealTime, PinsThisThread) {
  cpu_set_t before, after;
  sched_getaffinity(0, sizeof before, &before);
  int cpu = 0;
  while (!CPU_ISSET(static_cast<std::size_t>(cpu), &before)) ++cpu;
  EXPECT_EQ(pin_to(cpu), "");
  sched_getaffinity(0, sizeof after, &after);
  sched_setaffinity(0, sizeof before, &before);
  EXPECT_EQ(CPU_COUNT(&after), 1);
  EXPECT_TRUE(CPU_ISSET(static_cast<std::size_t>(cpu), &after));
}

/// The line of a file in /proc that begins with `name`.
std::string line_of(const std::string& path, const std::string& name) {
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);)
    if (line.rfind(name, 0) == 0) return line.substr(name.size());
  return "";
}

TEST(RealTime, OfADaemonTheLoopAlone) {
  TestFolder folder;
  const std::string scene = folder.write("scene.yaml", kSmallSceneYaml);
  Daemon daemon({"--scene", scene, "--shm", folder / "c.sock", "--real-time"});
  const std::string log = daemon.log(), process = "/proc/" + std::to_string(daemon.pid());
  for (const char* step : {"lock_memory", "prefault", "priority"})
    EXPECT_NE(log.find(std::string("step=") + step), std::string::npos) << log;
  const int policy = sched_getscheduler(daemon.pid());
  const bool is_first = log.find("event=real_time step=priority") != std::string::npos;
  EXPECT_EQ(policy == (SCHED_FIFO | SCHED_RESET_ON_FORK), is_first) << log;
  EXPECT_NE(is_first, log.find("event=real_time_rejected step=priority") != std::string::npos) << log;
  const bool is_locked = log.find("event=real_time step=lock_memory") != std::string::npos;
  EXPECT_EQ(std::stoul(line_of(process + "/status", "VmLck:")) > 0, is_locked) << log;
  int others = 0;
  for (const auto& task : std::filesystem::directory_iterator(process + "/task")) {
    const int thread = std::stoi(task.path().filename().string());
    if (thread == daemon.pid()) continue;
    EXPECT_EQ(sched_getscheduler(thread), SCHED_OTHER);
    ++others;
  }
  EXPECT_GE(others, 2) << "the workers";
  Client client = connect("shm://" + (folder / "c.sock"));
  EXPECT_GT(client.distances({}).rows(), 0u);
}

}  // namespace
}  // namespace clearance
