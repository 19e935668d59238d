#include "server/app/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>

#include "server/app/config_file.h"
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

Configuration file (--config): the same names, one on a line; the command line takes precedence.
  scene = "scenes/nineteen/scene.yaml"
  zmq = ["ipc:///run/user/1000/clearance.ipc"]
  log-level = "warn"
  [limits]
  max-clients = 500

Ready
  With Type=notify systemd is notified (sd_notify). --ready-fd N gets the urls of the daemon, one on a line, and is
  then closed; the log has event=ready. SIGTERM or SIGINT ends the daemon and removes its sockets.

Access rights
  The daemon's own user has all rights through the Unix sockets, a group those of --group-rights. Rights are
  query, poses (move, attach and add bodies) and admin (reload). TCP without keys and LCM identify no client: query, poses.
  The word control among rights gives the class of that name, as --control-user does; all others have the class planning.
    clearance keygen keys/server.key              for the daemon; clients get keys/server.key.pub
    clearance keygen planner.key                  for a client; prints its public key
    echo 'KEY query,poses planner' >> keys/authorized    read again within a second of a change

Reload
  SIGHUP or `clearance scene reload` reloads the scene in the background, while queries continue. Bodies of the same name
  keep received poses and attachments. If the scene cannot be loaded the old one stays, and the log has event=reload_failed.
)";

constexpr const char* kExitCodes = R"(
Exit codes
  0 ended by a signal, as it should be    3 the scene cannot be loaded
  1 an unexpected error                   4 an endpoint cannot be opened
  2 the command line is wrong             5 the backend is unknown or absent)";

/// A check without CLI11's own text, as the option's text has the range.
CLI::Validator quiet(CLI::Validator check) {
  return check.description("");
}

void add_endpoints(CLI::App& app, DaemonOptions& o) {
  app.add_option(
         "--scene", o.scene,
         "scene file (YAML), or a URDF: a scene of that robot, by the URDF's name; paths in it are relative to it")
      ->type_name("FILE")
      ->required();
  app.add_flag("--allow-outside", o.allow_outside, "allow meshes outside the scene's folder");
  app.add_option("--shm", o.shm,
                 "serve shared memory through this Unix socket; without any endpoint at\n" + default_socket_path())
      ->type_name("PATH");
  app.add_option(
         "--zmq", o.zmq,
         "serve ZeroMQ at ipc:///path, tcp://127.0.0.1:PORT, or with --keys tcp://ADDRESS:PORT;\nmay be repeated")
      ->type_name("ENDPOINT");
  app.add_option("--keys", o.keys,
                 "TCP for clients with authorized keys (CURVE): a folder with server.key and the list `authorized`,\n"
                 "a line for each client: KEY RIGHTS NAME (see Access rights)")
      ->type_name("DIR");
  app.add_option("--socket-group", o.socket_group, "let this group's members connect to the Unix sockets (mode 0660)")
      ->type_name("GROUP");
  app.add_option("--group-rights", o.group_rights,
                 "rights of that group: query, poses, admin, control, separated by commas")
      ->type_name("RIGHTS")
      ->capture_default_str();
  app.add_option(
         "--control-user", o.control_users,
         "user whose clients at the Unix sockets have the class control: they are served before other clients,\n"
         "which cannot use the connections and memory reserved for them; may be repeated")
      ->type_name("USER");
}

void add_lcm(CLI::App& app, DaemonOptions& o) {
  app.add_option(
         "--lcm", o.lcm,
         "serve LCM and follow poses there, as in \"udpm://239.255.76.67:7667?ttl=0\"; &prefix=TEXT begins the\n"
         "names of all channels, for several daemons on one network")
      ->type_name("URL");
  app.add_option(
         "--lcm-poses", o.lcm_poses,
         "bodies whose poses are accepted from LCM, to which any process on the network can send: on (all), off,\n"
         "or a body or group; may be repeated")
      ->type_name("WHOSE")
      ->default_str("on");
}

void add_backend(CLI::App& app, DaemonOptions& o) {
  app.add_option("--backend", o.backend, "auto, cpu, cuda, reference (slow brute force, for comparison)")
      ->type_name("NAME")
      ->capture_default_str();
  app.add_option("--threads", o.threads, "threads of the cpu backend; 0 for one per core")
      ->check(quiet(CLI::Range(0, 4096)))
      ->type_name("N")
      ->capture_default_str();
  app.add_option(
         "--devices", o.devices,
         "GPUs of the cuda backend by number, as in 0,1: each holds the scene, and queries are distributed among\n"
         "them; default: the first")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("N,N");
  app.add_flag("!--no-device-fallback", o.device_fallback,
               "reject queries that the device cannot answer, instead of using the CPU");
  app.add_option(
         "--covers", o.covers,
         "make covers, which speed up decisions: background (at the lowest priority, once the daemon is ready), off")
      ->check(quiet(CLI::IsMember({"background", "off"})))
      ->type_name("WHEN")
      ->capture_default_str();
}

void add_real_time(CLI::App& app, DaemonOptions& o) {
  CLI::Option* real_time = app.add_flag(
      "--real-time", o.real_time,
      "run the loop at real-time priority (SCHED_FIFO), without spinning, and lock memory; steps that the\n"
      "kernel does not permit are logged and skipped");
  app.add_option("--loop-cpu", o.loop_cpu, "with --real-time: the CPU that the loop runs on")
      ->check(quiet(CLI::Range(0, 1023)))
      ->type_name("N")
      ->needs(real_time);
}

/// A number that few users change, set in section [limits] of the configuration file or by --limit.
struct Limit {
  const char* name;
  std::uint64_t DaemonOptions::* value;
  std::uint64_t least, most;
  const char* text;
};
constexpr std::uint64_t kManyPairs = std::uint64_t{1} << 62, kManyPoints = std::uint64_t{1} << 30;
constexpr Limit kLimits[] = {
    {"max-waiting", &DaemonOptions::max_waiting, 1, 1'000'000,
     "queries of one client under way; more are rejected (busy)"},
    {"max-clients", &DaemonOptions::max_clients, 1, 1'000'000,
     "clients of one endpoint (shared memory: connected, ZeroMQ: with requests under way)"},
    {"max-client-mib", &DaemonOptions::max_client_mib, 1, 1'000'000,
     "MiB of one client's requests and replies under way; beyond it, one request passes at a time"},
    {"max-pairs", &DaemonOptions::max_pairs, 1, kManyPairs, "pairs times configurations of one query"},
    {"max-piece-pairs", &DaemonOptions::max_part_pairs, 1, kManyPairs, "the same in pairs of the bodies' convex parts"},
    {"max-body-points", &DaemonOptions::max_body_points, 0, kManyPoints, "points of one update of a point cloud"},
    {"max-client-points", &DaemonOptions::max_client_points, 0, kManyPoints,
     "points that one client has set or is sending"},
    {"max-points", &DaemonOptions::max_points, 0, kManyPoints, "points of all clients"},
    {"max-client-plans", &DaemonOptions::max_client_plans, 0, 100'000'000,
     "plans of one client in a GPU's memory (docs/cuda.md); 0 for none"},
    {"max-plans", &DaemonOptions::max_plans, 0, 100'000'000, "plans of all clients"},
    {"max-client-plan-mib", &DaemonOptions::max_client_plan_mib, 0, 100'000'000, "MiB of one client's plans"},
    {"max-plan-mib", &DaemonOptions::max_plan_mib, 0, 100'000'000, "MiB of all clients' plans"},
    {"max-added-bodies", &DaemonOptions::max_added_bodies, 0, 100'000, "bodies that clients have added"},
    {"max-added-vertices", &DaemonOptions::max_added_vertices, 1, 10'000'000, "vertices of an added body"},
    {"max-added-triangles", &DaemonOptions::max_added_triangles, 1, 20'000'000, "triangles of an added body"},
    {"max-added-points", &DaemonOptions::max_added_points, 1, 80'000,
     "points of an added body; later updates may have more"},
    {"max-stamp-lead-s", &DaemonOptions::max_stamp_lead_s, 0, 1'000'000'000,
     "seconds that a pose's stamp may be ahead of this machine's clock"},
    {"gateway-mib", &DaemonOptions::gateway_mib, 64, 1'000'000,
     "MiB of each gateway process for TCP and LCM beyond this machine; one that needs more is\n"
     "restarted. A request or reply may use an eighth of it"},
    {"device-memory-mib", &DaemonOptions::device_memory_mib, 0, 0xFFFF'FFFF, "MiB of each GPU; 0 for all of it"},
    {"pinned-mib", &DaemonOptions::pinned_mib, 0, 0xFFFF'FFFF,
     "MiB of clients' shared memory that a GPU writes large replies to; 0 to copy them"},
    {"slice-us", &DaemonOptions::slice_us, 1, 1'000'000, "microseconds of one query before other queries run"},
    {"spin-us", &DaemonOptions::spin_us, 0, 1'000'000, "microseconds to poll before going to sleep; 0 for none"},
};

/// The limits with their defaults, for --help.
std::string limits_text() {
  constexpr std::size_t kTextAt = 38;
  std::string all =
      "\nLimits: section [limits] of the configuration file, as in max-points = 1000, or --limit max-points=1000\n";
  for (const Limit& limit : kLimits) {
    std::string line = "  " + std::string(limit.name);
    line.resize(23, ' ');
    line += std::to_string(DaemonOptions().*limit.value);
    line.resize(kTextAt, ' ');
    for (const char c : std::string_view(limit.text)) {
      line += c;
      if (c == '\n') line.append(kTextAt, ' ');
    }
    all += line + "\n";
  }
  return all;
}

/// Throws std::invalid_argument for an unknown name and for a value out of its range.
void set_limit(const std::string& name, const std::string& value, DaemonOptions& o) {
  const auto* const limit = std::find_if(std::begin(kLimits), std::end(kLimits),
                                         [&](const Limit& candidate) { return candidate.name == name; });
  if (limit == std::end(kLimits)) throw std::invalid_argument("there is no limit \"" + name.substr(0, 60) + "\"");
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || number < limit->least || number > limit->most)
    throw std::invalid_argument(name + ": expected a number from " + std::to_string(limit->least) + " to " +
                                std::to_string(limit->most) + ", got " + value.substr(0, 60));
  o.*limit->value = number;
}

/// Sets a limit from the command line, such as "max-points=1000".
void set_limit(const std::string& text, DaemonOptions& o) try {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) throw std::invalid_argument("expected NAME=N, got " + text.substr(0, 60));
  set_limit(text.substr(0, equals), text.substr(equals + 1), o);
} catch (const std::invalid_argument& error) {
  throw CLI::ValidationError("--limit", error.what());
}

void add_watching(CLI::App& app, DaemonOptions& o) {
  app.add_option(
         "--metrics", o.metrics,
         "counters in Prometheus' text format by HTTP, at 127.0.0.1:PORT/metrics or on a Unix socket (its path);\n"
         "the distinct errors at /errors")
      ->type_name("ENDPOINT");
  app.add_option("--log-level", o.log_level, "level of the log on standard error: debug, info, warn, error")
      ->check(quiet(CLI::IsMember({"trace", "debug", "info", "warn", "error"})))
      ->type_name("LEVEL")
      ->capture_default_str();
  app.add_option("--ready-fd", o.ready_fd, "open file descriptor to notify when the daemon is ready")
      ->check(quiet(CLI::Range(0, 1 << 20)))
      ->type_name("N");
}

/// Absolute path, as clients may run in another folder.
std::string absolute_path(const std::string& path) {
  if (path.empty()) return path;
  const std::filesystem::path absolute = std::filesystem::absolute(path);
  const bool leads_up = std::find(absolute.begin(), absolute.end(), "..") != absolute.end();
  return (leads_up ? absolute : absolute.lexically_normal()).string();  // ".." behind a link leads elsewhere
}

/// Whether --metrics names a Unix socket instead of HOST:PORT.
bool is_socket_path(const std::string& endpoint) {
  if (endpoint.find('/') != std::string::npos) return true;
  return endpoint.find(':') == std::string::npos && endpoint != "localhost" &&
         endpoint.find_first_not_of("0123456789.") != std::string::npos;
}

}  // namespace

bool parse_options(int argc, const char* const* argv, DaemonOptions& o, int& exit_code) {
  CLI::App app(kDescription, "clearanced");
  app.footer(std::string(kFooter) + limits_text() + kExitCodes);
  app.set_version_flag("--version", std::string("clearanced ") + CLEARANCE_VERSION);
  app.set_config("--config", "", "read options from this file (TOML or INI)")->type_name("FILE");
  const auto config = std::make_shared<ConfigFile>(app);
  app.config_formatter(config);
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.get_formatter()->column_width(26);
  add_endpoints(app, o);
  add_lcm(app, o);
  add_backend(app, o);
  add_real_time(app, o);
  std::vector<std::string> limits;
  app.add_option("--limit", limits, "one of the limits below; may be repeated")
      ->type_name("NAME=N")
      ->configurable(false);
  app.add_flag(
      "--require-epoch", o.require_epoch,
      "reject requests that involve poses and have no epoch (docs/service/wire.md): a client that would not notice "
      "a\nrestart gets no answer");
  add_watching(app, o);

  try {
    app.parse(argc, argv);
    config->for_each_limit([&o](const std::string& name, const std::string& value) { set_limit(name, value, o); });
    for (const std::string& limit : limits) set_limit(limit, o);
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
