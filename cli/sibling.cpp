// Commands that are programs of their own: what needs the engine is not linked into this client.
#include <unistd.h>

#include <cstring>
#include <stdexcept>

#include "commands.h"

namespace clearance::cli {
namespace {

/// The folder of this program; empty where the system does not tell.
std::string own_folder() {
  char path[4096];
  const ssize_t size = readlink("/proc/self/exe", path, sizeof path);
  if (size <= 0 || size == static_cast<ssize_t>(sizeof path)) return {};
  const std::string whole(path, static_cast<std::size_t>(size));
  return whole.substr(0, whole.rfind('/'));
}

/// Goes on as another program: the one beside this one, else the one on PATH. Returns only by throwing.
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

const char* const kWithDaemon =
    "; it is installed with the daemon (component server, or pip install without CLEARANCE_CLIENT_ONLY)";

/// A command that is the program clearance-NAME. \param why it is one. \param remedy how it is installed.
void add_program(CLI::App& app, const char* name, const char* description, const char* why,
                 const char* remedy = kWithDaemon) {
  auto& command = *app.add_subcommand(name, description);
  command.prefix_command();  // every option is the program's own, --help too
  command.set_help_flag();
  command.callback([&command, name, why, remedy] {
    become(std::string("clearance-") + name, command.remaining(), std::string(why) + remedy);
  });
}

}  // namespace

void add_inspect(CLI::App& app) {
  add_program(app, "inspect", "what a scene file's bodies are modelled by, its cost, what could be left out",
              "reads scenes");
}

void add_robot(CLI::App& app) {
  add_program(app, "robot", "what a URDF holds, and where joint positions put its links: inspect, fk", "reads robots");
}

void add_decompose(CLI::App& app) {
  add_program(app, "decompose", "convex pieces for a mesh, and a proof of how far they miss it", "proves distances");
}

void add_selftest(CLI::App& app) {
  add_program(app, "selftest", "whether each way to answer that this machine has computes rightly",
              "computes distances");
}

void add_cache(CLI::App& app) {
  add_program(app, "cache", "what is kept of meshes that were loaded before: list, clear", "knows the engine's cache");
}

void add_view(CLI::App& app) {
  add_program(app, "view", "a browser page of a scene, its distances and a daemon", "is part of the Python package",
              "; pip install \"WHEEL[view]\", where WHEEL is the file clearance-*.whl");
}

void add_sweep(CLI::App& app) {
  add_program(app, "sweep", "answers a job of many configurations or motions in parts, as Parquet",
              "is part of the Python package",
              "; pip install \"WHEEL[sweep]\", where WHEEL is the file clearance-*.whl");
}

}  // namespace clearance::cli
