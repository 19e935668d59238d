// clearanced: loads a scene, opens its endpoints, and serves until a signal ends it.
#include <fcntl.h>
#include <malloc.h>
#include <signal.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "accepting.h"
#include "client/default_socket.h"
#include "doorman.h"
#include "engine/cache/cache.h"
#include "engine/engine.h"
#include "engine/mesh.h"
#include "engine/self_test.h"
#include "key_ring.h"
#include "log_text.h"
#include "loop.h"
#include "metrics.h"
#include "options.h"
#include "readiness.h"
#include "scene_log.h"
#include "shm_transport.h"

namespace clearance {
namespace {

std::atomic<Loop*> running_loop{nullptr};
std::atomic<int> last_signal{0};

void on_signal(int number) {
  Loop* loop = running_loop.load();
  if (loop && number == SIGHUP) return loop->reload();
  last_signal = number;
  if (loop) loop->stop();
}

void handle_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaction(number, &action, nullptr);
  // A peer that is gone and a file that may not grow (a segment beyond RLIMIT_FSIZE) are errors of a call.
  action.sa_handler = SIG_IGN;
  for (const int number : {SIGPIPE, SIGXFSZ}) sigaction(number, &action, nullptr);
}

void start_log(const DaemonOptions& options) {
  auto logger = std::make_shared<spdlog::logger>("clearanced", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("time=%Y-%m-%dT%H:%M:%S.%e%z level=%l %v");
  logger->set_level(spdlog::level::from_str(options.log_level));
  logger->flush_on(spdlog::level::trace);
  spdlog::set_default_logger(std::move(logger));
}

/// Says why the daemon does not start: one sentence on standard error.
int fail(ExitCode code, const std::string& sentence) {
  std::fprintf(stderr, "clearanced: %s\n", log_text(sentence, false).c_str());
  return code;
}

/// Has OpenMP's threads sleep, not spin, where they wait for each other. On a machine that the daemon shares with
/// planners a spinning thread keeps the core from the very thread that it waits for: queries were seen to take 20 times
/// as long. libgomp reads the setting before main() begins, so this starts the program anew, in the same process. A
/// setting that is there is left alone.
void let_threads_sleep(char** argv) {
  if (getenv("OMP_WAIT_POLICY")) return;
  char path[4096];
  const ssize_t size = readlink("/proc/self/exe", path, sizeof path - 1);
  if (size <= 0) return;
  path[size] = '\0';
  setenv("OMP_WAIT_POLICY", "passive", 1);
  execv(path, argv);  // if that fails, we go on as we are
}

/// Has memory that a query gave back stay with the process. By its defaults the C library returns what is free at the end
/// of the heap to the system from 128 KB on, and a query that needs as much then has the kernel clear the same pages
/// again: batches of 171 pairs were seen to take 200 us instead of 110. Larger blocks still come and go by mmap().
void keep_freed_memory() {
#ifdef __GLIBC__
  mallopt(M_TRIM_THRESHOLD, 64 << 20);
  mallopt(M_MMAP_THRESHOLD, 8 << 20);
#endif
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Where nothing was asked for, what needs no set-up is served.
void add_default_endpoint(DaemonOptions& options) {
  if (!options.shm.empty() || !options.zmq.empty() || !options.lcm.empty()) return;
  const std::string folder = default_socket_folder();
  mkdir(folder.c_str(), 0700);  // only /tmp/clearance-UID may be missing
  struct stat info {};
  if (stat(folder.c_str(), &info) || info.st_uid != getuid())
    throw std::runtime_error("shm://" + default_socket_path() + ": the folder " + folder +
                             " is not ours; choose an endpoint with --shm or --zmq");
  options.shm.push_back(default_socket_path());
}

/// Who may come in, as the options say. Throws std::invalid_argument, and std::runtime_error for key files.
Access access_of(const DaemonOptions& options) {
  Access access;
  const auto option = [](const char* name, auto read) {
    try {
      return read();
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(std::string(name) + ": " + error.what());
    }
  };
  if (!options.socket_group.empty())
    access.group = option("--socket-group", [&] { return group_named(options.socket_group); });
  access.group_rights = option("--group-rights", [&] { return parse_rights(options.group_rights); });
  access.max_clients = options.max_clients;
  if (!options.keys.empty()) access.keys = std::make_shared<KeyRing>(options.keys);
  return access;
}

std::unique_ptr<Transport> open_shm(const std::string& path, [[maybe_unused]] const Access& access,
                                    [[maybe_unused]] std::uint64_t pinned_bytes) {
#ifdef CLEARANCE_HAVE_SHM
  ShmLimits limits;
  limits.max_clients = access.max_clients;
  limits.pinned_bytes = pinned_bytes;
  return make_shm_transport(path, limits, access);
#else
  throw std::runtime_error("shm://" + path + ": this clearanced was built without shared memory");
#endif
}

/// Throws std::invalid_argument for options that contradict each other or name what the scene does not have.
LcmPoses lcm_poses_of(const DaemonOptions& options, const Scene& scene) {
  const bool list = options.lcm_poses == "allowlist";
  if (list == options.lcm_allow.empty())
    throw std::invalid_argument(list ? "--lcm-poses allowlist: name bodies or groups with --lcm-allow"
                                     : "--lcm-allow: only with --lcm-poses allowlist");
  for (const std::string& name : options.lcm_allow)
    if (scene.find_body(name) == kNone && scene.find_group(name) == kNone)
      throw std::invalid_argument("--lcm-allow: the scene has no body or group \"" + name + "\"");
  return {options.lcm_poses == "on", options.lcm_allow};
}

std::unique_ptr<Transport> open_lcm(const std::string& url, [[maybe_unused]] const std::string& prefix,
                                    [[maybe_unused]] const LcmPoses& poses) {
#ifdef CLEARANCE_HAVE_LCM
  return make_lcm_transport(url, prefix, poses);
#else
  throw std::runtime_error(url + ": this clearanced was built without LCM");
#endif
}

void open_endpoints(Loop& loop, DaemonOptions& options, const Access& access, const LcmPoses& lcm_poses) {
  reserve_descriptor();
  spdlog::info("event=descriptors_of_strangers refused_by={}", kernel_refuses_descriptors() ? "kernel" : "doorman");
  add_default_endpoint(options);
  for (const std::string& path : options.shm) loop.add(open_shm(path, access, std::uint64_t{options.pinned_mib} << 20));
  for (const std::string& endpoint : options.zmq) loop.add(make_zmq_transport(endpoint, access));
  if (!options.lcm.empty()) loop.add(open_lcm(options.lcm, options.lcm_prefix, lcm_poses));
}

/// systemd names the unit's CacheDirectory= in the environment; CLEARANCE_CACHE says otherwise.
void use_cache_directory() {
  const char* folders = std::getenv("CACHE_DIRECTORY");
  if (!folders) return;
  const std::string first(folders, std::strcspn(folders, ":"));
  if (!first.empty()) ::setenv("CLEARANCE_CACHE", first.c_str(), 0);
}

Scene load_scene(const DaemonOptions& options) {
  if (const std::string why = Cache::of_environment().why_off(); !why.empty())
    spdlog::warn("event=cache_off text=\"nothing is kept of meshes: {}\"", log_text(why));
  Scene scene = Scene::load(options.scene, options.allow_outside);
  if (const std::string missing = mesh_loader_warning(); !missing.empty())
    spdlog::warn("event=mesh_loader_unfiltered text=\"{}\"", log_text(missing));
  return scene;
}

void log_scene(const DaemonOptions& options, const Engine& engine, double load_seconds) {
  std::size_t pieces = 0, vertices = 0;
  for (const Body& body : engine.scene().bodies()) {
    pieces += body.pieces.size();
    for (const PiecePtr& piece : body.pieces) vertices += piece->vertices.size();
  }
  spdlog::info(
      "event=scene_loaded scene=\"{}\" bodies={} pieces={} vertices={} revision={:016x} backend={} seconds={:.3f}",
      log_text(options.scene), engine.scene().bodies().size(), pieces, vertices, engine.scene_revision(), engine.backend(),
      load_seconds);
  log_hull_warnings(engine.scene());
}

int serve(DaemonOptions options) {
  const auto begin = std::chrono::steady_clock::now();
  const Supervisor supervisor;
  use_cache_directory();
  if (options.ready_fd >= 0) {
    if (fcntl(options.ready_fd, F_GETFD) < 0)
      return fail(kExitCommandLine, "--ready-fd: descriptor " + std::to_string(options.ready_fd) + " is not open");
    fcntl(options.ready_fd, F_SETFD, FD_CLOEXEC);
  }
  start_log(options);
  spdlog::info("event=start version={} pid={}", CLEARANCE_VERSION, getpid());

  Access access;
  try {
    access = access_of(options);
  } catch (const std::invalid_argument& error) {
    return fail(kExitCommandLine, error.what());
  } catch (const std::runtime_error& error) {
    return fail(kExitEndpoint, "--keys: " + std::string(error.what()));
  }
  Engine::Options engine_options;
  engine_options.backend = options.backend;
  engine_options.threads = options.threads;
  engine_options.warm_memory = std::uint64_t{options.max_warm_mib} << 20;
  engine_options.device_memory = std::uint64_t{options.device_memory_mib} << 20;
  engine_options.device_fallback = options.device_fallback;
  engine_options.calibration = options.calibration;
  engine_options.devices = options.devices;
  engine_options.max_stamp_lead = std::chrono::seconds(options.max_stamp_lead_s);
  try {
    Engine probe(Scene{}, engine_options);  // a wrong backend is said before the scene is loaded, which may take long
  } catch (const std::exception& error) {
    return fail(kExitBackend, error.what());
  }
  for (const SelfTest& test : self_tests())
    if (!test.passed())
      spdlog::error("event=self_test_failed name={} wrong={} answers={} first=\"{}\" text=\"it is not used\"", test.name, test.wrong,
                    test.answers, test.first_wrong);
  std::optional<Scene> scene;
  try {
    scene = load_scene(options);
  } catch (const SceneError& error) {
    return fail(kExitScene, error.what());
  }
  LcmPoses lcm_poses;
  try {
    lcm_poses = lcm_poses_of(options, *scene);
  } catch (const std::invalid_argument& error) {
    return fail(kExitCommandLine, error.what());
  }
  const auto engine = std::make_shared<Engine>(std::move(*scene), engine_options);
  const double load_seconds = seconds_since(begin);
  log_scene(options, *engine, load_seconds);

  Loop::Options loop_options;
  loop_options.slice = std::chrono::microseconds(options.slice_us);
  loop_options.spin = std::chrono::microseconds(options.spin_us);
  loop_options.max_waiting_per_client = options.max_waiting;
  loop_options.max_client_bytes = std::uint64_t{options.max_client_mib} << 20;
  loop_options.max_added_bodies = options.max_added_bodies;
  loop_options.max_added_vertices = options.max_added_vertices;
  loop_options.max_pairs_per_query = options.max_pairs;
  Loop loop(engine, loop_options);
  const auto build = [engine_options](Scene scene_to_serve) {
    return std::make_unique<Engine>(std::move(scene_to_serve), engine_options);
  };
  loop.reload_by([&options, build] { return build(load_scene(options)); }, build);
  running_loop = &loop;
  handle_signals();  // from here on there are sockets to remove
  std::optional<MetricsServer> metrics;
  try {
    open_endpoints(loop, options, access, lcm_poses);
    if (!options.metrics.empty()) {
      metrics.emplace(options.metrics, [&loop] { return loop.read_figures(std::chrono::milliseconds(500)); });
      spdlog::info("event=metrics url={}", log_text(metrics->url()));
    }
  } catch (const std::runtime_error& error) {
    running_loop = nullptr;
    return fail(kExitEndpoint, error.what());
  }

  std::vector<std::string> urls;
  for (const auto& transport : loop.transports()) urls.push_back(transport->url());
  std::string all;
  for (const std::string& url : urls) all += (all.empty() ? "" : " ") + url;
  spdlog::info("event=ready urls=\"{}\" load_seconds={:.3f}", log_text(all), load_seconds);
  if (options.ready_fd >= 0) write_ready(options.ready_fd, urls);
  supervisor.ready("serving " + options.scene + " at " + all);

  loop.run();
  metrics.reset();

  supervisor.stopping();
  running_loop = nullptr;
  spdlog::info("event=end signal={} frames={} queries={} errors={} uptime_seconds={:.1f}", last_signal.load(),
               loop.counter("frames"), loop.counter("queries"), loop.counter("errors"), seconds_since(begin));
  if (loop.is_reloading()) {  // nobody waits for a scene that nobody will ask about
    loop.close_transports();
    spdlog::shutdown();
    std::_Exit(kExitClean);
  }
  return kExitClean;
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) {
  clearance::DaemonOptions options;
  int exit_code = 0;
  if (!clearance::parse_options(argc, argv, options, exit_code)) return exit_code;
  clearance::let_threads_sleep(argv);
  clearance::keep_freed_memory();
  try {
    return clearance::serve(std::move(options));
  } catch (const std::exception& error) {
    return clearance::fail(clearance::kExitUnexpected, std::string("unexpected error: ") + error.what());
  }
}
