#include "tests/server/daemon_fixture.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace clearance {
namespace {

std::string read_file(const std::string& path) {
  std::ifstream in(path);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::string read_all(int fd) {
  std::string text;
  char buffer[4096];
  for (ssize_t size; (size = read(fd, buffer, sizeof buffer)) > 0;) text.append(buffer, static_cast<std::size_t>(size));
  return text;
}

int code_of(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

/// Forks and executes a program. Descriptors 1 and 2 go to files; `ready` becomes descriptor 3 unless it is -1.
pid_t spawn(const std::vector<std::string>& command, const std::vector<std::string>& environment,
            const std::string& out, const std::string& err, int ready = -1) {
  std::vector<char*> arguments, variables;
  for (const auto& text : command) arguments.push_back(const_cast<char*>(text.c_str()));
  arguments.push_back(nullptr);
  for (const auto& text : environment) variables.push_back(const_cast<char*>(text.c_str()));
  for (char** v = environ; *v; ++v) variables.push_back(*v);
  variables.push_back(nullptr);
  const int out_fd = open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const int err_fd = open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error("fork failed");
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // ends the daemon with a test that is killed
    dup2(out_fd, 1);
    dup2(err_fd, 2);
    if (ready >= 0 && ready != 3) dup2(ready, 3);
    if (ready == 3) fcntl(3, F_SETFD, 0);
    close_range(ready >= 0 ? 4 : 3, ~0u, 0);  // liblcm's descriptors of this process are inherited otherwise
    execve(arguments[0], arguments.data(), variables.data());
    _exit(127);
  }
  close(out_fd);
  close(err_fd);
  return pid;
}

}  // namespace

const char* const kSmallSceneYaml = R"(bodies:
  - {name: table, box: [2, 1, 0.1], static: true, pose: [0,0,0, 1,0,0,0]}
  - {name: cup, sphere: 0.1, pose: [0,0,0.3, 1,0,0,0]}
  - {name: link1, capsule: [0.05, 0.4], pose: [0.5,0,0.5, 1,0,0,0]}
  - {name: link2, capsule: [0.05, 0.4]}
groups: {arm: [link1, link2]}
)";

TestFolder::TestFolder() {
  std::string folder = (std::filesystem::temp_directory_path() / "clearance-XXXXXX").string();
  if (!mkdtemp(folder.data())) throw std::runtime_error("mkdtemp failed");
  path_ = folder;
}
TestFolder::~TestFolder() {
  std::filesystem::remove_all(path_);
}

std::string TestFolder::write(const std::string& name, const std::string& contents) const {
  std::ofstream(path_ + "/" + name) << contents;
  return path_ + "/" + name;
}

std::string program(const std::string& name) {
  std::error_code unknown;
  const auto beside = std::filesystem::read_symlink("/proc/self/exe", unknown).parent_path() / name;
  if (!unknown && std::filesystem::exists(beside)) return beside.string();
  return std::string(CLEARANCE_BINARY_DIR) + "/bin/" + name;
}

Finished run(const std::vector<std::string>& command, const std::vector<std::string>& environment) {
  const TestFolder folder;
  const pid_t pid = spawn(command, environment, folder / "out", folder / "err");
  int status = 0;
  waitpid(pid, &status, 0);
  return {code_of(status), read_file(folder / "out"), read_file(folder / "err")};
}

Daemon::Daemon(std::vector<std::string> options, const std::vector<std::string>& environment) {
  options.insert(options.begin(), program("clearanced"));
  options.insert(options.end(), {"--ready-fd", "3"});
  int ready[2];
  if (pipe2(ready, O_CLOEXEC)) throw std::runtime_error("pipe failed");
  pid_ = spawn(options, environment, folder_ / "out", folder_ / "err", ready[1]);
  close(ready[1]);
  std::istringstream urls(read_all(ready[0]));  // ends when the daemon is ready, or dead
  close(ready[0]);
  for (std::string url; std::getline(urls, url);) urls_.push_back(url);
  if (urls_.empty()) {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    throw std::runtime_error("clearanced ended with " + std::to_string(code_of(status)) + ": " + log());
  }
}

Daemon::~Daemon() {
  if (pid_ > 0) stop(SIGTERM);
}

int Daemon::stop(int signal) {
  kill(pid_, signal);
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = -1;
  return code_of(status);
}

std::string Daemon::log() const {
  return read_file(folder_ / "err");
}

}  // namespace clearance
