#include "tests/faults/arena.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <thread>

#include "tests/faults/victim/victim.h"
#include "tests/lcm/lcm_network.h"
#include "tests/source_file.h"

namespace clearance::faults {

using namespace std::chrono_literals;

const std::string kScene = source_file("scenes/random_100/scene.yaml");

namespace {

/// A private LCM network on this host; empty if packets do not come back.
std::string lcm_url() {
  const std::optional<LcmAddress> address = own_lcm_address("faults");
  return address ? address->url() : "";
}

int code_of(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace

// --- Victim

Victim::Victim(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), program("fault_victim"));
  std::vector<char*> pointers;
  for (std::string& text : arguments) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addclosefrom_np(&actions, 3);  // liblcm's descriptors are inherited otherwise
  const int error = posix_spawn(&pid_, pointers[0], &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error) throw std::runtime_error(arguments[0] + ": " + std::strerror(error));
}

Victim::Victim(Victim&& other) noexcept : pid_(std::exchange(other.pid_, -1)), ended_with_(other.ended_with_) {}

Victim::~Victim() {
  if (pid_ <= 0) return;
  signal(SIGKILL);
  await_end();
}

void Victim::signal(int number) const {
  if (pid_ > 0) kill(pid_, number);
}

bool Victim::await_stop() {
  int status = 0;
  while (waitpid(pid_, &status, WUNTRACED) < 0 && errno == EINTR) {
  }
  if (WIFSTOPPED(status)) return true;
  pid_ = -1;
  ended_with_ = code_of(status);
  return false;
}

int Victim::await_end() {
  if (pid_ <= 0) return ended_with_;
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return ended_with_ = code_of(status);
}

// --- Arena

Arena::Arena(std::vector<std::string> options, const std::string& scene) : command_(std::move(options)) {
  command_.insert(command_.begin(), {"--scene", scene, "--backend", "cpu", "--threads", "1", "--log-level", "warn",
                                     "--shm", folder_ / "c.sock", "--zmq", "ipc://" + (folder_ / "c.ipc")});
  if (const std::string lcm = lcm_url(); !lcm.empty()) command_.insert(command_.end(), {"--lcm", lcm});
  daemon_ = std::make_unique<Daemon>(command_, std::vector{"TMPDIR=" + temporary_.path()});
  urls_ = daemon_->urls();
}

void Arena::kill_and_restart() {
  daemon_->stop(SIGKILL);
  daemon_ = std::make_unique<Daemon>(command_, std::vector{"TMPDIR=" + temporary_.path()});
}

bool Arena::has_ended() const {
  siginfo_t info{};
  const auto pid = static_cast<id_t>(daemon_->pid());
  return waitid(P_PID, pid, &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid != 0;
}

int Arena::end() {
  return daemon_->stop(SIGTERM);
}

Census Arena::census() const {
  return census_of(daemon_->pid(), {folder_.path(), temporary_.path()});
}

std::string Arena::await_census(const Census& before) const {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  for (;;) {
    const std::string left = left_behind(before, census());
    if (left.empty() || std::chrono::steady_clock::now() > deadline) return left;
    std::this_thread::sleep_for(2ms);
  }
}

Victim Arena::talk(const std::string& url, std::string_view point, int signal, std::uint64_t seed) const {
  return Victim({"talk", url, std::to_string(seed), std::string(point), std::to_string(signal)});
}

std::vector<std::string_view> points_of(const std::string& url) {
  if (url.rfind("shm://", 0) == 0) return {std::begin(kShmPoints), std::end(kShmPoints)};
  if (url.rfind("ipc://", 0) == 0) return {std::begin(kZmqPoints), std::end(kZmqPoints)};
  return {std::begin(kLcmPoints), std::end(kLcmPoints)};
}

Stats stats_of(Client& client) {
  Stats stats;
  for (const auto& [name, value] : client.stats()) stats[name] = value;
  return stats;
}

void await_covers(Client& client) {
  while (stats_of(client)["engine.covers_pending"] > 0) std::this_thread::sleep_for(2ms);
}

std::string unbalanced(const Stats& stats) {
  const auto of = [&stats](const char* name) {
    const auto found = stats.find(name);
    return found == stats.end() ? 0 : found->second;
  };
  const std::uint64_t replies = of("replies"), errors = of("errors"), dropped = of("requests.dropped"),
                      waiting = of("requests.waiting");
  if (of("frames") == replies + errors + dropped + waiting) return "";
  return std::to_string(of("frames")) + " requests came in; " + std::to_string(replies) + " replies, " +
         std::to_string(errors) + " refusals, " + std::to_string(dropped) + " dropped with their clients and " +
         std::to_string(waiting) + " under way do not make that";
}

}  // namespace clearance::faults
