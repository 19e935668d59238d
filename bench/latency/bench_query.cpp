#include "bench/latency/bench_query.h"

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "cli/commands.h"

namespace clearance::cli {

namespace {

const std::map<std::string, Reduce> kBenchReductions{
    {"none", Reduce::kNone}, {"within", Reduce::kWithin}, {"nearest", Reduce::kNearest}, {"min", Reduce::kMin}};

}  // namespace

void add_query_options(CLI::App& command, BenchQueryOptions& options) {
  command.add_option("--pairs", options.pairs, "pairs drawn from the scene's; 0 for all enabled pairs")
      ->type_name("N")
      ->capture_default_str();
  command
      .add_option("--configs", options.configurations,
                  "configurations of --moved bodies around their current poses;\n0 for the current poses")
      ->check(quiet(CLI::Range(0u, 10'000'000u)))
      ->type_name("K")
      ->capture_default_str();
  command.add_option("--moved", options.moved, "bodies that a configuration moves")
      ->check(quiet(CLI::Range(1u, 100'000u)))
      ->type_name("M")
      ->capture_default_str();
  command.add_option("--jitter", options.jitter_m, "how far they move: metres and radians, standard deviation")
      ->check(quiet(CLI::Range(0.0, 1e6)))
      ->type_name("S")
      ->capture_default_str();
  command.add_option("--seed", options.seed, "of the pairs and configurations drawn")
      ->type_name("N")
      ->capture_default_str();
  command.add_option("--precision", options.precision, "f64, f32")
      ->check(quiet(CLI::IsMember({"f64", "f32"})))
      ->type_name("WORD")
      ->capture_default_str();
  command.add_option("--reduce", options.reduce, "none, within (--max-distance), nearest, min")
      ->check(quiet(CLI::IsMember({"none", "within", "nearest", "min"})))
      ->type_name("WORD")
      ->capture_default_str();
  command
      .add_option("--max-distance", options.max_distance, "pairs proved farther than this many metres are \"beyond\"")
      ->check(quiet(CLI::NonNegativeNumber))
      ->type_name("M");
}

std::vector<std::uint32_t> movable_bodies(const SceneInfo& scene, const std::vector<BodyStateInfo>& states) {
  std::vector<std::uint32_t> bodies;
  for (std::uint32_t b = 0; b < scene.bodies.size(); ++b)
    if (!scene.bodies[b].is_static && states[b].parent == kNone && states[b].status == Status::kOk) bodies.push_back(b);
  return bodies;
}

Pose7 jittered(const Pose7& pose, double sigma_m, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0, sigma_m);
  const double a = noise(random) / 2, b = noise(random) / 2, c = noise(random) / 2;
  const double w = pose[3], x = pose[4], y = pose[5], z = pose[6];
  // (1, a, b, c) * q: a small rotation in world axes, which the daemon normalises.
  Pose7 moved{pose[0] + noise(random),   pose[1] + noise(random),   pose[2] + noise(random),  w - a * x - b * y - c * z,
              x + a * w + b * z - c * y, y + b * w + c * x - a * z, z + c * w + a * y - b * x};
  const double norm = std::sqrt(moved[3] * moved[3] + moved[4] * moved[4] + moved[5] * moved[5] + moved[6] * moved[6]);
  for (int i = 3; i < 7; ++i) moved[i] /= norm;
  return moved;
}

BenchQuery make_query(Client& client, const BenchQueryOptions& o) {
  std::mt19937_64 random(o.seed);
  BenchQuery q;
  q.query.max_distance = o.max_distance;
  q.query.reduce = kBenchReductions.at(o.reduce);
  q.query.precision = kPrecisionNames.at(o.precision);
  if (o.configurations > 0) {
    const SceneInfo& scene = client.scene();
    const std::vector<BodyStateInfo> states = client.body_states();
    q.bodies = movable_bodies(scene, states);
    if (q.bodies.empty())
      throw std::invalid_argument(
          "--configs: no body of the scene can be moved: each is static, has a parent, or has no pose");
    std::shuffle(q.bodies.begin(), q.bodies.end(), random);
    q.bodies.resize(std::min<std::size_t>(q.bodies.size(), o.moved));
    std::sort(q.bodies.begin(), q.bodies.end());
    for (std::uint32_t k = 0; k < o.configurations; ++k)
      for (const std::uint32_t body : q.bodies)
        q.configurations.push_back(jittered(states[body].pose, o.jitter_m, random));
    q.query.bodies = q.bodies;
    q.query.configurations = q.configurations;
  }
  if (o.pairs > 0) {
    q.pairs = client.pairs(q.query);
    if (q.pairs.size() < o.pairs)
      throw std::invalid_argument("--pairs: the scene has " + std::to_string(q.pairs.size()) + " enabled pairs" +
                                  (o.configurations > 0 ? " with a moved body" : "") + "; 0 asks for all of them");
    std::shuffle(q.pairs.begin(), q.pairs.end(), random);
    q.pairs.resize(o.pairs);
    std::sort(q.pairs.begin(), q.pairs.end());
    q.query.pairs = q.pairs;
  }
  return q;
}

void expect_mode_first(const CLI::App& bench) {
  for (const CLI::Option* option : bench.get_options())
    if (option->count() > 0) throw std::invalid_argument("bench: " + option->get_name() + " belongs behind the mode");
}

std::string bench_command_line(const CLI::App& command) {
  std::string line;
  if (const int nice = ::getpriority(PRIO_PROCESS, 0); nice != 0) line += "nice -n " + std::to_string(nice) + " ";
  if (const int policy = ::sched_getscheduler(0); policy == SCHED_FIFO || policy == SCHED_RR) {
    sched_param real_time{};
    ::sched_getparam(0, &real_time);
    line +=
        std::string("chrt ") + (policy == SCHED_FIFO ? "-f " : "-r ") + std::to_string(real_time.sched_priority) + " ";
  }
  cpu_set_t cpus;
  const long online = ::sysconf(_SC_NPROCESSORS_ONLN);
  if (::sched_getaffinity(0, sizeof cpus, &cpus) == 0 && CPU_COUNT(&cpus) < online) {
    std::string list;
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
      if (CPU_ISSET(cpu, &cpus)) list += (list.empty() ? "" : ",") + std::to_string(cpu);
    line += "taskset -c " + list + " ";
  }
  const bool is_mode = command.get_parent()->get_name() == "bench";
  line += std::string(is_mode ? "clearance bench " : "clearance ") + command.get_name();
  for (const CLI::Option* option : command.get_options())
    for (const std::string& value : option->results())
      if (option->get_name() != "--csv" && option->get_name() != "--help")
        line += " " + option->get_name() + (option->get_items_expected_max() == 0 ? "" : " " + value);
  return line;
}

}  // namespace clearance::cli
