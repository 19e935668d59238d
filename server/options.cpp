#include "options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>

#include "config_file.h"
#include "wire/default_socket.h"

namespace clearance {
namespace {

constexpr const char* kDescription =
    "Loads a scene of bodies, follows their poses, and answers how far apart they are.\n"
    "Clients (the program clearance, the C++ and Python libraries, or anything that speaks LCM) connect\n"
    "to one of its endpoints; all of them give the same answers.";

constexpr const char* kFooter = R"(
Example
  clearanced --scene scenes/nineteen/scene.yaml --zmq ipc:///tmp/clearance.ipc &
  clearance query --connect ipc:///tmp/clearance.ipc --reduce nearest

Configuration file (--config): the same names, one on a line; the command line has the last word.
  scene = "scenes/nineteen/scene.yaml"
  zmq = ["ipc:///run/user/1000/clearance.ipc"]
  log-level = "warn"

Ready
  With Type=notify systemd is told (sd_notify). --ready-fd N gets the urls of the daemon, one on a line, and is
  then closed; the log says event=ready. SIGTERM or SIGINT end the daemon and remove its sockets.

Who may do what
  The daemon's own user may do everything through the Unix sockets, a group what --group-rights says. Rights are
  query (ask), poses (move, attach and add bodies) and admin (reload). TCP without keys and LCM know nobody: query, poses.
  The word control among rights gives the class of that name, as --control-user does; all others have the class planning.
    clearance keygen keys/server.key              for the daemon; clients get keys/server.key.pub
    clearance keygen planner.key                  for a client; prints its public key
    echo 'KEY query,poses planner' >> keys/authorized    read again within a second of a change

Reload
  SIGHUP, or `clearance reload`, has the scene loaded anew, aside; queries go on. Poses and attachments that were received stay with the
  bodies of the same names. If the scene cannot be loaded the old one stays, and the log says event=reload_failed.

Exit codes
  0 ended by a signal, as it should be    3 the scene cannot be loaded
  1 an error that nobody foresaw          4 an endpoint cannot be opened
  2 the command line is wrong             5 the backend is unknown or absent)";

/// A check without the words that CLI11 has for it: what a number may be is said in the option's own.
CLI::Validator quiet(CLI::Validator check) {
  return check.description("");
}

void add_endpoints(CLI::App& app, DaemonOptions& o) {
  app.add_option(
         "--scene", o.scene,
         "scene file (YAML), or a URDF: a scene of that robot, by the URDF's name; paths in it are relative to it")
      ->type_name("FILE")
      ->required();
  app.add_flag("--allow-outside", o.allow_outside, "let the scene name meshes outside its own folder");
  app.add_option(
         "--shm", o.shm,
         "serve shared memory, met at this Unix socket; where no endpoint is given, at\n" + default_socket_path())
      ->type_name("PATH");
  app.add_option(
         "--zmq", o.zmq,
         "serve ZeroMQ at ipc:///path, tcp://127.0.0.1:PORT, or with --keys tcp://ADDRESS:PORT;\nmay be repeated")
      ->type_name("ENDPOINT");
  app.add_option(
         "--keys", o.keys,
         "TCP for those alone whose keys are known (CURVE): a folder with server.key and the list `authorized`,\n"
         "a line for each client: KEY RIGHTS NAME (see Who may do what)")
      ->type_name("DIR");
  app.add_option("--socket-group", o.socket_group, "let this group's members connect to the Unix sockets (mode 0660)")
      ->type_name("GROUP");
  app.add_option("--group-rights", o.group_rights,
                 "what they may do: query, poses, admin, control, separated by commas")
      ->type_name("RIGHTS")
      ->capture_default_str();
  app.add_option(
         "--control-user", o.control_users,
         "a user whose clients at the Unix sockets have the class control: they are answered before the others,\n"
         "who cannot take the places and the memory kept for them; may be repeated")
      ->type_name("USER");
}

void add_lcm(CLI::App& app, DaemonOptions& o) {
  app.add_option(
         "--lcm", o.lcm,
         "serve LCM and follow poses there, as in \"udpm://239.255.76.67:7667?ttl=0\"; &prefix=TEXT begins the\n"
         "names of all channels: several daemons on one network")
      ->type_name("URL");
  app.add_option("--lcm-poses", o.lcm_poses,
                 "whose poses are taken from LCM, where anybody who reaches it may send them: on (every body's), off,\n"
                 "or a body or group; may be repeated")
      ->type_name("WHOSE")
      ->default_str("on");
}

void add_backend(CLI::App& app, DaemonOptions& o) {
  app.add_option("--backend", o.backend,
                 "what computes: auto, cpu, cuda, reference (slow: brute force, to compare with)")
      ->type_name("NAME")
      ->capture_default_str();
  app.add_option("--threads", o.threads, "threads of the cpu backend; 0: one for each core")
      ->check(quiet(CLI::Range(0, 4096)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option(
         "--devices", o.devices,
         "GPUs of the cuda backend by number, as in 0,1: each holds the scene, and queries are shared out among\n"
         "them; where none is named, the first")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("N,N");
  app.add_option("--device-memory-mib", o.device_memory_mib,
                 "MiB of each GPU's memory that the cuda backend may take; 0: what there is")
      ->type_name("N")
      ->capture_default_str();
  app.add_flag("!--no-device-fallback", o.device_fallback,
               "refuse what the device cannot answer; else the CPU answers it");
  app.add_option("--pinned-mib", o.pinned_mib,
                 "MiB of clients' shared memory that are pinned where the device has large replies for them, so that "
                 "it writes\n"
                 "them there itself; 0: they are copied")
      ->type_name("N")
      ->capture_default_str();
}

void add_times(CLI::App& app, DaemonOptions& o) {
  app.add_option("--slice-us", o.slice_us, "microseconds that one query may take before the others get a turn")
      ->check(quiet(CLI::Range(1u, 1000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--spin-us", o.spin_us, "microseconds to poll after the last work before going to sleep; 0: none")
      ->check(quiet(CLI::Range(0u, 1000000u)))
      ->type_name("N")
      ->capture_default_str();
  CLI::Option* real_time = app.add_flag(
      "--real-time", o.real_time,
      "run the loop at real-time priority (SCHED_FIFO), without spinning, and keep memory from being paged out; what\n"
      "the kernel refuses is said in the log, and done without");
  app.add_option("--loop-cpu", o.loop_cpu, "with --real-time: the CPU that the loop runs on")
      ->check(quiet(CLI::Range(0, 1023)))
      ->type_name("N")
      ->needs(real_time);
}

void add_limits(CLI::App& app, DaemonOptions& o) {
  app.add_option("--max-waiting", o.max_waiting, "queries that one client may have under way; more are refused (busy)")
      ->check(quiet(CLI::Range(1u, 1000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option(
         "--max-clients", o.max_clients,
         "clients of one endpoint (shared memory: connected, ZeroMQ: with requests under way); more are refused")
      ->check(quiet(CLI::Range(1u, 1000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--outside-mib", o.outside_mib,
                 "MiB of memory that each process has which stands before TCP and LCM beyond this machine; one that "
                 "needs more\nends, and is started again. A request or reply may have an eighth of it")
      ->check(quiet(CLI::Range(64u, 1000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option(
         "--max-client-mib", o.max_client_mib,
         "MiB that one client's requests and replies under way may take; more are refused (busy), though one always\n"
         "may. Its warm state has what is left")
      ->check(quiet(CLI::Range(1u, 1000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--max-warm-mib", o.max_warm_mib,
                 "MiB of all clients' warm state; beyond it, who was silent for longest begins cold again")
      ->check(quiet(CLI::Range(0u, 1000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--max-pairs", o.max_pairs,
                 "pairs times configurations that one query may ask about; more are refused")
      ->check(quiet(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 62)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--max-piece-pairs", o.max_piece_pairs,
                 "the same, counted in pairs of the bodies' pieces, before any of them is looked at")
      ->check(quiet(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 62)))
      ->type_name("N")
      ->capture_default_str();
  const auto add_points = [&](const char* name, std::uint64_t& most, const char* what) {
    app.add_option(name, most, what)
        ->check(quiet(CLI::Range(std::uint64_t{0}, std::uint64_t{1} << 30)))
        ->type_name("N")
        ->capture_default_str();
  };
  add_points("--max-body-points", o.max_body_points, "points that one update of a body of points may have");
  add_points("--max-client-points", o.max_client_points, "points that a client may have set, and under way");
  add_points("--max-points", o.max_points, "points of all clients");
  const auto add_plans = [&](const char* name, unsigned& most, const char* what) {
    app.add_option(name, most, what)->check(quiet(CLI::Range(0u, 100'000'000u)))->type_name("N")->capture_default_str();
  };
  add_plans("--max-client-plans", o.max_client_plans,
            "plans that one client may have open in a GPU's memory (docs/cuda.md); 0: none is opened");
  add_plans("--max-plans", o.max_plans, "plans of all clients");
  add_plans("--max-client-plan-mib", o.max_client_plan_mib, "MiB of a GPU's memory that one client's plans may take");
  add_plans("--max-plan-mib", o.max_plan_mib, "MiB of all clients' plans");
  app.add_option("--max-added-bodies", o.max_added_bodies, "bodies that clients may have added to the scene")
      ->check(quiet(CLI::Range(0u, 100000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--max-added-vertices", o.max_added_vertices, "vertices that each of them may have")
      ->check(quiet(CLI::Range(1u, 10000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--max-added-triangles", o.max_added_triangles, "triangles that each of them may have")
      ->check(quiet(CLI::Range(1u, 20000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--max-added-points", o.max_added_points,
                 "points that each of them may have when it is added; what replaces them may be more")
      ->check(quiet(CLI::Range(1u, 80000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option(
         "--max-stamp-lead-s", o.max_stamp_lead_s,
         "seconds that the stamp of a pose may be ahead of this machine's clock; poses farther ahead are refused")
      ->check(quiet(CLI::Range(0u, 1000000000u)))
      ->type_name("N")
      ->capture_default_str();
  app.add_flag("--require-epoch", o.require_epoch,
               "refuse requests that deal with poses and name no epoch (docs/wire.md): a client that would not notice "
               "a\nrestart gets no answer");
}

void add_watching(CLI::App& app, DaemonOptions& o) {
  app.add_option(
         "--metrics", o.metrics,
         "counters in Prometheus' text format by HTTP, at 127.0.0.1:PORT/metrics or on a Unix socket (its path);\n"
         "the distinct errors at /errors")
      ->type_name("ENDPOINT");
  app.add_option("--log-level", o.log_level, "what goes to standard error: debug, info, warn, error")
      ->check(quiet(CLI::IsMember({"trace", "debug", "info", "warn", "error"})))
      ->type_name("LEVEL")
      ->capture_default_str();
  app.add_option("--ready-fd", o.ready_fd, "open descriptor that is told when the daemon is ready")
      ->check(quiet(CLI::Range(0, 1 << 20)))
      ->type_name("N");
}

/// Clients may run in another folder: what they connect to is an absolute path.
std::string absolute_path(const std::string& path) {
  if (path.empty()) return path;
  const std::filesystem::path absolute = std::filesystem::absolute(path);
  const bool leads_up = std::find(absolute.begin(), absolute.end(), "..") != absolute.end();
  return (leads_up ? absolute : absolute.lexically_normal()).string();  // ".." behind a link leads elsewhere
}

/// Whether --metrics names a Unix socket: not HOST:PORT, nor one of the two alone.
bool is_socket_path(const std::string& endpoint) {
  if (endpoint.find('/') != std::string::npos) return true;
  return endpoint.find(':') == std::string::npos && endpoint != "localhost" &&
         endpoint.find_first_not_of("0123456789.") != std::string::npos;
}

}  // namespace

bool parse_options(int argc, const char* const* argv, DaemonOptions& o, int& exit_code) {
  CLI::App app(kDescription, "clearanced");
  app.footer(kFooter);
  app.set_version_flag("--version", std::string("clearanced ") + CLEARANCE_VERSION);
  app.set_config("--config", "", "read options from this file (TOML or INI)")->type_name("FILE");
  const auto config = std::make_shared<ConfigFile>(app);
  app.config_formatter(config);
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.get_formatter()->column_width(26);
  add_endpoints(app, o);
  add_lcm(app, o);
  add_backend(app, o);
  add_times(app, o);
  add_limits(app, o);
  add_watching(app, o);

  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help_or_version) {
    exit_code = app.exit(help_or_version);
    return false;
  } catch (const CLI::ParseError& error) {
    std::cerr << "clearanced: " << config->place_of(error.what(), {argv, static_cast<std::size_t>(argc)})
              << error.what() << "\nclearanced --help lists the options.\n";
    exit_code = kExitCommandLine;
    return false;
  }
  for (std::string& path : o.shm) path = absolute_path(path);
  if (is_socket_path(o.metrics)) o.metrics = absolute_path(o.metrics);
  return true;
}

}  // namespace clearance
