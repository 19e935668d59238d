#include "engine/base/helper_program.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "engine/base/fd.h"

extern char** environ;

namespace clearance {

namespace fs = std::filesystem;

namespace {

struct Kind {
  const char* word;
  int access;
};

std::string helper_file(const Kind& kind, const std::string& name, const char* variable, const char* built,
                        const std::string& what) {
  const auto serves = [&kind](const fs::path& path) {
    return ::access(path.c_str(), kind.access) == 0 && !fs::is_directory(path);
  };
  if (const char* set = std::getenv(variable); set && *set) {
    if (!serves(set)) throw std::runtime_error(std::string(variable) + "=" + set + " is not a " + kind.word);
    return set;
  }
  std::vector<fs::path> places;
  Dl_info self{};
  if (::dladdr(reinterpret_cast<const void*>(&helper_program), &self) && self.dli_fname)
    places.push_back(fs::path(self.dli_fname).parent_path());
  std::error_code error;
  if (const fs::path program = fs::read_symlink("/proc/self/exe", error); !error)
    places.push_back(program.parent_path());
  for (const fs::path& place : places) {
    for (const fs::path& folder : {place, place / "libexec", place / ".." / "libexec", place / ".." / ".." / "libexec"})
      if (!place.empty() && serves(folder / name)) return (folder / name).string();
  }
  if (built && serves(built)) return built;
  throw std::runtime_error(std::string("the ") + kind.word + " " + name + what + " is neither next to " +
                           (self.dli_fname ? self.dli_fname : "this program") + " nor in a libexec folder; set " +
                           variable + " to its path");
}

}  // namespace

std::string helper_program(const std::string& name, const char* variable, const char* built, const std::string& what) {
  return helper_file({"program", X_OK}, name, variable, built, what);
}

std::string helper_library(const std::string& name, const char* variable, const char* built, const std::string& what) {
  return helper_file({"library", R_OK}, name, variable, built, what);
}

pid_t start_helper(const std::string& program, std::vector<std::string> arguments, std::span<const int> descriptors) {
  const auto fail = [&program](int error) {
    throw std::runtime_error("cannot start " + program + ": " + std::generic_category().message(error));
  };
  std::vector<char*> words{const_cast<char*>(program.c_str())};
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  std::vector<Fd> moved;  // copies above their final numbers
  for (const int fd : descriptors) {
    moved.emplace_back(::fcntl(fd, F_DUPFD_CLOEXEC, 10));
    if (!moved.back()) fail(errno);
  }

  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  ::posix_spawn_file_actions_init(&files);
  ::posix_spawnattr_init(&attributes);
  ::posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0);
  for (std::size_t i = 0; i < moved.size(); ++i)
    ::posix_spawn_file_actions_adddup2(&files, moved[i].get(), static_cast<int>(3 + i));
  sigset_t none, all;
  ::sigemptyset(&none);
  ::sigfillset(&all);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setsigdefault(&attributes, &all);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  pid_t pid = -1;
  const int error = ::posix_spawn(&pid, program.c_str(), &files, &attributes, words.data(), environ);
  ::posix_spawn_file_actions_destroy(&files);
  ::posix_spawnattr_destroy(&attributes);
  if (error) fail(error);
  return pid;
}

}  // namespace clearance
