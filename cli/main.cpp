// clearance: queries a running clearanced from the command line, and inspects scenes, robots and meshes.
#include <iostream>

#include "cli/commands.h"

namespace clearance {
namespace {

constexpr const char* kFooter = R"(
Example
  clearance query --connect ipc:///tmp/clearance.ipc --pairs arm,table --fields distance,points

The daemon is found by --connect, else by the environment variable CLEARANCE_URL, else at this user's
default socket. A daemon on TCP with keys needs CLEARANCE_SERVER_KEY and CLEARANCE_KEY, or both in the
url (`clearance keygen --help`). `clearance COMMAND --help` lists a command's options.

Exit codes
  0 answered    1 the daemon rejected the request, and nothing has changed    2 the command line or a file is wrong
  3 no connection, or no answer in time. A command's own --help has those that differ)";

#ifdef CLEARANCE_HAVE_ENGINE
constexpr const char* kLeftOut = "";
#else
constexpr const char* kLeftOut =
    "; inspect, robot, selftest and cache are installed with the daemon, not with a client alone";
#endif

void add_commands(CLI::App& app) {
  cli::add_bodies(app);
  cli::add_query(app);
  cli::add_joints(app);
  cli::add_path(app);
  cli::add_scene(app);
  cli::add_stat(app);
  cli::add_keygen(app);
#ifdef CLEARANCE_HAVE_BENCH
  cli::add_bench(app);
#endif
#ifdef CLEARANCE_HAVE_ENGINE
  cli::add_inspect(app);
  cli::add_robot(app);
  cli::add_selftest(app);
  cli::add_cache(app);
#endif
  cli::add_view(app);
  cli::add_sweep(app);
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) {
  using namespace clearance;
  constexpr int kRejected = 1, kCommandLine = 2, kNoConnection = 3;

  CLI::App app("Queries a running clearanced, and inspects scenes, robots and meshes.", "clearance");
  app.set_version_flag("--version", std::string("clearance ") + CLEARANCE_VERSION);
  app.require_subcommand(1);
  add_commands(app);
  app.footer(kFooter);  // last: a subcommand would inherit it

  const auto fail = [](int code, const char* what) {
    std::cerr << "clearance: " << what << "\n";
    return code;
  };
  try {
    app.parse(argc, argv);
    return std::cout.flush() ? 0 : kRejected;
  } catch (const CLI::Success& help_or_version) {
    return app.exit(help_or_version);
  } catch (const CLI::ParseError& error) {
    if (app.get_subcommands().empty() && argc > 1 && argv[1][0] != '-')
      return fail(
          kCommandLine,
          ("there is no command \"" + std::string(argv[1]) + "\"; clearance --help lists them" + kLeftOut).c_str());
    return fail(kCommandLine, error.what());
  } catch (const std::invalid_argument& error) {
    return fail(kCommandLine, error.what());
  } catch (const ConnectionError& error) {
    return fail(kNoConnection, error.what());
  } catch (const std::exception& error) {
    return fail(kRejected, error.what());
  }
}
