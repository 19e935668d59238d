// Commands that are separate Python programs.
#include <unistd.h>

#include <cstring>
#include <stdexcept>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

/// Returns the folder of this program; empty if unknown.
std::string own_folder() {
  char path[4096];
  const ssize_t size = readlink("/proc/self/exe", path, sizeof path);
  if (size <= 0 || size == static_cast<ssize_t>(sizeof path)) return {};
  const std::string whole(path, static_cast<std::size_t>(size));
  return whole.substr(0, whole.rfind('/'));
}

/// Replaces this process by another program of its folder, else of PATH. Returns only by throwing.
[[noreturn]] void become(const std::string& program, const std::vector<std::string>& arguments,
                         const std::string& remedy) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const std::string folder = own_folder();
  if (!folder.empty()) execv((folder + "/" + program).c_str(), argv.data());
  execvp(program.c_str(), argv.data());
  throw std::runtime_error("the program " + program + " " + remedy + "; there is none in " +
                           (folder.empty() ? std::string() : folder + " nor ") + "on PATH (" + std::strerror(errno) +
                           ")");
}

/// A command that is the program clearance-NAME, of the Python package's extra NAME.
void add_program(CLI::App& app, const std::string& name, const char* description) {
  auto& command = *app.add_subcommand(name, description);
  command.prefix_command();  // passes on every option, --help included
  command.set_help_flag();
  command.callback([&command, name] {
    become(
        "clearance-" + name, command.remaining(),
        "is part of the Python package; pip install \"WHEEL[" + name + "]\", where WHEEL is the file clearance-*.whl");
  });
}

}  // namespace

void add_view(CLI::App& app) {
  add_program(app, "view", "show a scene and its distances in a browser");
}

void add_sweep(CLI::App& app) {
  add_program(app, "sweep", "answers a job of many configurations or motions in parts, as Parquet");
}

}  // namespace clearance::cli
