// clearanced loads a scene, opens its endpoints, and serves until a signal ends it.
#include <fcntl.h>
#include <malloc.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "engine/cache/cache.h"
#include "engine/engine.h"
#include "engine/mesh/mesh.h"
#include "engine/narrow/self_test.h"
#include "server/app/endpoints.h"
#include "server/app/options.h"
#include "server/app/readiness.h"
#include "server/base/log.h"
#include "server/base/log_text.h"
#include "server/base/real_time.h"
#include "server/core/loop.h"
#include "server/core/scene_log.h"
#include "server/metrics/metrics.h"

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
  struct sigaction action{};
  action.sa_handler = on_signal;
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaction(number, &action, nullptr);
  // Ignored, so that writing to a closed socket or beyond RLIMIT_FSIZE (a segment) is an error of the call.
  action.sa_handler = SIG_IGN;
  for (const int number : {SIGPIPE, SIGXFSZ}) sigaction(number, &action, nullptr);
}

/// Reason for which the daemon does not start.
struct Failure {
  ExitCode code;
  std::string sentence;
};

/// Prints one sentence to standard error, and returns the exit code.
int fail(ExitCode code, const std::string& sentence) {
  std::fprintf(stderr, "clearanced: %s\n", log_text(sentence, false).c_str());
  return code;
}

/// Makes OpenMP's threads sleep instead of spin while they wait. If planners share the machine, a spinning thread keeps
/// the core from the thread that it waits for, which made queries up to 20 times slower. libgomp reads the setting
/// before main(), so this executes the program again in the same process. An existing setting is kept.
void let_threads_sleep(char** argv) {
  if (getenv("OMP_WAIT_POLICY")) return;
  char path[4096];
  const ssize_t size = readlink("/proc/self/exe", path, sizeof path - 1);
  if (size <= 0) return;
  path[size] = '\0';
  setenv("OMP_WAIT_POLICY", "passive", 1);
  execv(path, argv);  // without effect if it fails
}

/// Keeps freed memory in the process. By default the C library returns free memory at the heap's end to the system from
/// 128 KB on, and the kernel clears the same pages again for the next query: batches of 171 pairs took 200 us instead
/// of 110. Larger blocks still use mmap().
void keep_freed_memory() {
#ifdef __GLIBC__
  mallopt(M_TRIM_THRESHOLD, 64 << 20);
  mallopt(M_MMAP_THRESHOLD, 8 << 20);
#endif
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// CLEARANCE_CACHE overrides the unit's CacheDirectory=, which systemd passes in the environment.
void use_cache_directory() {
  const char* folders = std::getenv("CACHE_DIRECTORY");
  if (!folders) return;
  const std::string first(folders, std::strcspn(folders, ":"));
  if (!first.empty()) ::setenv("CLEARANCE_CACHE", first.c_str(), 0);
}

engine::Scene load_scene(const DaemonOptions& options) {
  if (const std::string why = Cache::of_environment().why_off(); !why.empty())
    log::warn("event=cache_off text=\"meshes are not cached: {}\"", log_text(why));
  engine::Scene scene = engine::Scene::load(options.scene, options.allow_outside);
  if (const std::string missing = mesh_loader_warning(); !missing.empty())
    log::warn("event=mesh_loader_unfiltered text=\"{}\"", log_text(missing));
  return scene;
}

void log_scene(const DaemonOptions& options, const engine::Engine& engine, double load_seconds) {
  std::size_t parts = 0, vertices = 0;
  for (const Body& body : engine.scene().bodies()) {
    parts += body.parts.size();
    for (const ConvexPartPtr& part : body.parts) vertices += part->vertices.size();
  }
  log::info(
      "event=scene_loaded scene=\"{}\" bodies={} pieces={} vertices={} revision={:016x} backend={} seconds={:.3f}",
      log_text(options.scene), engine.scene().bodies().size(), parts, vertices, engine.scene_revision(),
      engine.backend(), load_seconds);
  log_mesh_warnings(engine.scene(), mesh_warnings(engine.scene()));
  log_file_warnings(engine.scene());
}

/// Runs `work`, and turns an Error that it throws into a Failure with this code.
template <class Error, class Work>
auto or_fail(ExitCode code, const std::string& place, Work work) {
  try {
    return work();
  } catch (const Error& error) {
    throw Failure{code, place + error.what()};
  }
}

void keep_ready_fd(const DaemonOptions& options) {
  if (options.ready_fd < 0) return;
  if (fcntl(options.ready_fd, F_GETFD) < 0)
    throw Failure{kExitCommandLine, "--ready-fd: descriptor " + std::to_string(options.ready_fd) + " is not open"};
  fcntl(options.ready_fd, F_SETFD, FD_CLOEXEC);
}

engine::Engine::Options engine_options_of(const DaemonOptions& options) {
  engine::Engine::Options engine;
  engine.backend = options.backend;
  engine.threads = options.threads;
  engine.device_memory = std::uint64_t{options.device_memory_mib} << 20;
  engine.device_fallback = options.device_fallback;
  engine.devices = options.devices;
  engine.covers = engine::covers_named(options.covers);
  engine.max_stamp_lead = std::chrono::seconds(options.max_stamp_lead_s);
  return engine;
}

Loop::Options loop_options_of(const DaemonOptions& options, const Access& access) {
  Loop::Options loop;
  loop.slice = std::chrono::microseconds(options.slice_us);
  loop.spin = std::chrono::microseconds(options.real_time ? 0 : options.spin_us);  // kernels throttle what never sleeps
  loop.max_waiting_per_client = options.max_waiting;
  loop.max_client_bytes = std::uint64_t{options.max_client_mib} << 20;
  loop.max_added_bodies = options.max_added_bodies;
  loop.max_points_of_body = options.max_body_points;
  loop.max_points_of_client = options.max_client_points;
  loop.max_points = options.max_points;
  loop.max_added_vertices = options.max_added_vertices;
  loop.max_added_triangles = options.max_added_triangles;
  loop.max_added_points = options.max_added_points;
  loop.max_pairs = options.max_pairs;
  loop.max_part_pairs = options.max_part_pairs;
  loop.max_plans_of_client = options.max_client_plans;
  loop.max_plans = options.max_plans;
  loop.max_plan_bytes_of_client = std::uint64_t{options.max_client_plan_mib} << 20;
  loop.max_plan_bytes = std::uint64_t{options.max_plan_mib} << 20;
  loop.require_epoch = options.require_epoch;
  loop.has_control = access.has_control();
  if (loop.has_control) loop.kept_for_control = kept_for_control(loop.max_waiting_bytes);
  return loop;
}

/// Rejects a wrong backend before the scene is loaded, which may take long.
void check_backend(const engine::Engine::Options& options) {
  or_fail<std::exception>(kExitBackend, "", [&] { engine::Engine probe(engine::Scene{}, options); });
  for (const SelfTest& test : self_tests())
    if (!test.passed())
      log::error("event=self_test_failed name={} wrong={} answers={} first=\"{}\" text=\"it is not used\"", test.name,
                 test.wrong, test.answers, test.first_wrong);
}

/// Reports readiness to the log, the readiness descriptor and the supervisor.
void log_ready(const Loop& loop, const DaemonOptions& options, const Supervisor& supervisor, double load_seconds) {
  std::vector<std::string> urls;
  for (const auto& transport : loop.transports()) urls.push_back(transport->url());
  std::string all;
  for (const std::string& url : urls) all += (all.empty() ? "" : " ") + url;
  log::info("event=ready urls=\"{}\" load_seconds={:.3f} epoch={:016x}", log_text(all), load_seconds, loop.epoch());
  if (options.ready_fd >= 0) write_ready(options.ready_fd, urls);
  supervisor.ready("serving " + options.scene + " at " + all);
}

/// Directs signals to a loop while this exists.
struct SignalledLoop {
  explicit SignalledLoop(Loop& loop) {
    running_loop = &loop;
    handle_signals();
  }
  ~SignalledLoop() { running_loop = nullptr; }
};

void open_metrics(Loop& loop, const DaemonOptions& options, std::optional<MetricsServer>& metrics) {
  if (options.metrics.empty()) return;
  metrics.emplace(options.metrics, [&loop] { return loop.read_metrics(std::chrono::milliseconds(500)); });
  log::info("event=metrics url={}", log_text(metrics->url()));
}

// Ends the process at once if requests are still at work.
void end_service(Loop& loop, Supervisor& supervisor, std::chrono::steady_clock::time_point begin) {
  supervisor.stopping();
  log::info("event=end signal={} frames={} queries={} errors={} uptime_seconds={:.1f}", last_signal.load(),
            loop.counter("frames"), loop.counter("queries"), loop.counter("errors"), seconds_since(begin));
  if (loop.is_reloading() || loop.is_working()) {  // their clients will get no reply
    loop.close_transports();
    log::end();
    std::_Exit(kExitClean);
  }
}

int serve(DaemonOptions options) {
  const auto begin = std::chrono::steady_clock::now();
  Supervisor supervisor;
  use_cache_directory();
  keep_ready_fd(options);
  log::start(options.log_level);
  log::info("event=start version={} pid={}", CLEARANCE_VERSION, getpid());

  const Access access = or_fail<std::invalid_argument>(kExitCommandLine, "", [&] {
    return or_fail<std::runtime_error>(kExitEndpoint, "--keys: ", [&] { return access_of(options); });
  });
  engine::Engine::Options engine_options = engine_options_of(options);
  check_backend(engine_options);
  engine::Scene scene = or_fail<engine::SceneError>(kExitScene, "", [&] { return load_scene(options); });
  const LcmPoses lcm_poses =
      or_fail<std::invalid_argument>(kExitCommandLine, "", [&] { return lcm_poses_of(options, scene); });
  const auto engine = std::make_shared<engine::Engine>(std::move(scene), engine_options);
  const double load_seconds = seconds_since(begin);
  log_scene(options, *engine, load_seconds);

  Loop::Options loop_options = loop_options_of(options, access);
  loop_options.on_tick = [&supervisor] { supervisor.alive(); };
  Loop loop(engine, loop_options);
  engine_options.cover_store = engine->cover_store();
  engine_options.joint_table_store = engine->joint_table_store();
  const auto build = [engine_options](engine::Scene scene_to_serve) {
    return std::make_unique<engine::Engine>(std::move(scene_to_serve), engine_options);
  };
  loop.reload_by([&options, build] { return build(load_scene(options)); }, build);
  const SignalledLoop signalled(loop);  // from here on there are sockets to remove
  std::optional<MetricsServer> metrics;
  or_fail<std::runtime_error>(kExitEndpoint, "", [&] {
    open_endpoints(loop, options, access, lcm_poses);
    open_metrics(loop, options, metrics);
  });
  if (options.real_time)  // once other threads, which do not get it, have started
    become_real_time(options.loop_cpu >= 0 ? std::optional(options.loop_cpu) : std::nullopt);
  log_ready(loop, options, supervisor, load_seconds);

  loop.run();
  metrics.reset();

  end_service(loop, supervisor, begin);
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
  } catch (const clearance::Failure& failure) {
    return clearance::fail(failure.code, failure.sentence);
  } catch (const std::exception& error) {
    return clearance::fail(clearance::kExitUnexpected, std::string("unexpected error: ") + error.what());
  }
}
