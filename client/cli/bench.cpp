// clearance bench: how long queries take, and how much of that is the transport's bare minimum.
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <random>

#include "bench_floor.h"
#include "bench_report.h"
#include "bench_samples.h"
#include "client/default_socket.h"
#include "client/protocol.h"
#include "client/wire.h"
#include "commands.h"

namespace clearance::cli {

namespace {

/// The run is cut into so many rounds of floor and daemon by turns, so that what else the machine does hits both.
constexpr int kRounds = 5;
/// Time spent on each of the two floors, as a part of the time spent on the daemon.
constexpr double kFloorPart = 0.5;
/// Lost replies in a row after which nobody is there.
constexpr int kMostLost = 20;

const std::map<std::string, Reduce> kReduceNames{
    {"none", Reduce::kNone}, {"within", Reduce::kWithin}, {"nearest", Reduce::kNearest}, {"min", Reduce::kMin}};
const std::map<std::string, Precision> kPrecisionNames{{"f64", Precision::kF64}, {"f32", Precision::kF32}};

struct Options {
  Connection connection;
  Output output = Output::kTable;
  std::uint64_t pairs = 0;
  std::uint32_t configurations = 0;
  std::uint32_t moved = 6;
  double jitter_m = 0.05;
  std::uint64_t seed = 1;
  std::string rate = "closed", reduce = "none", precision = "f64";
  double max_distance = std::numeric_limits<double>::infinity();
  double seconds = 5, warmup_s = 1;
  int spin_us = -1;  ///< -1: as the url says
  std::string csv;
  std::string command;  ///< as it was typed
};

/// A query over real poses, with the memory that it looks at.
struct BenchQuery {
  std::vector<IdPair> pairs;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose7> configurations;
  Query query;
};

/// A pose moved by normal noise: `sigma_m` metres each way, as many radians about each axis.
Pose7 jittered(const Pose7& pose, double sigma_m, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0, sigma_m);
  const double a = noise(random) / 2, b = noise(random) / 2, c = noise(random) / 2;
  const double w = pose[3], x = pose[4], y = pose[5], z = pose[6];
  // (1, a, b, c) * q: a small turn in the world's axes; the daemon normalises it.
  Pose7 moved{pose[0] + noise(random),   pose[1] + noise(random),   pose[2] + noise(random),  w - a * x - b * y - c * z,
              x + a * w + b * z - c * y, y + b * w + c * x - a * z, z + c * w + a * y - b * x};
  const double norm = std::sqrt(moved[3] * moved[3] + moved[4] * moved[4] + moved[5] * moved[5] + moved[6] * moved[6]);
  for (int i = 3; i < 7; ++i) moved[i] /= norm;
  return moved;
}

BenchQuery make_query(Client& client, const Options& o) {
  std::mt19937_64 random(o.seed);
  BenchQuery q;
  q.query.max_distance = o.max_distance;
  q.query.reduce = kReduceNames.at(o.reduce);
  q.query.precision = kPrecisionNames.at(o.precision);
  if (o.configurations > 0) {
    const SceneInfo& scene = client.scene();
    const std::vector<BodyStateInfo> states = client.body_states();
    for (std::uint32_t b = 0; b < scene.bodies.size(); ++b)
      if (!scene.bodies[b].is_static && states[b].parent == kNone && states[b].status == Status::kOk)
        q.bodies.push_back(b);
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

EchoSize size_of(const Query& query, const Reply& reply) {
  const std::uint64_t configurations = query.bodies.empty() ? 0 : query.configurations.size() / query.bodies.size();
  return {
      sizeof(wire::FrameHeader) + wire::query_payload_bytes(query.pairs.size(), query.bodies.size(), configurations),
      sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader) + wire::columns_bytes(reply.rows(), reply.fields())};
}

/// Runs daemon and floor by turns and fills the report's series.
void measure(Client& client, const Query& query, Floor& floor, const Options& o, BenchReport& report) {
  int lost_in_a_row = 0;
  const auto ask = [&]() -> Exchanged {
    try {
      const Reply reply = client.distances(query);
      lost_in_a_row = 0;
      return {true, static_cast<std::int64_t>(reply.server_ns()), static_cast<std::int64_t>(reply.engine_ns())};
    } catch (const TimeoutError&) {
      if (++lost_in_a_row >= kMostLost) throw;
      return {.answered = false};
    }
  };
  int echoes_lost_in_a_row = 0;
  const auto echo = [&](std::chrono::nanoseconds held) -> Exchanged {
    const bool answered = floor.exchange(held);
    echoes_lost_in_a_row = answered ? 0 : echoes_lost_in_a_row + 1;
    if (echoes_lost_in_a_row >= kMostLost) throw std::runtime_error("floor: messages do not come back");
    return {.answered = answered};
  };
  const auto drive_floor = [&](std::chrono::nanoseconds held, double seconds, Series& series) {
    floor.tune(held);
    drive([&] { return echo(held); }, report.rate_hz, seconds, series);
  };
  Series warm, cold;
  drive(ask, report.rate_hz, o.warmup_s, warm);
  if (warm.engine.size() == 0) drive(ask, 0, 0.01, warm);
  report.held = std::chrono::nanoseconds(std::llround(1e3 * warm.engine.percentile_us(0.5)));
  drive_floor({}, o.warmup_s * kFloorPart, cold);
  for (int round = 0; round < kRounds; ++round) {
    drive_floor({}, o.seconds * kFloorPart / kRounds, report.floor);
    drive_floor(report.held, o.seconds * kFloorPart / kRounds, report.held_floor);
    drive(ask, report.rate_hz, o.seconds / kRounds, report.ours);
  }
  report.ended_early = report.ours.latency.full() || report.floor.latency.full();
}

double parse_rate(const std::string& text) {
  if (text == "closed") return 0;
  std::size_t end = 0;
  double rate = 0;
  try {
    rate = std::stod(text, &end);
  } catch (const std::exception&) {
  }
  if (end != text.size() || !(rate > 0) || rate > 1e6)
    throw std::invalid_argument("--rate: expected \"closed\" or requests a second up to 1000000, got \"" + text + "\"");
  return rate;
}

/// Connects, spinning as long as `--spin-us` says.
Client open(const Options& o) {
  Connection connection = o.connection;
  if (o.spin_us >= 0) {
    if (connection.url.empty()) connection.url = "shm://" + default_socket_path();
    if (connection.url.rfind("shm://", 0) != 0)
      throw std::invalid_argument("--spin-us: only for shared memory; the others wait in the kernel");
    connection.url +=
        (connection.url.find('?') == std::string::npos ? "?spin_us=" : "&spin_us=") + std::to_string(o.spin_us);
  }
  return connection.open();
}

void run(const Options& o) {
  BenchReport report;
  report.rate_hz = parse_rate(o.rate);
  if (!o.csv.empty()) check_csv(o.csv);
  Client client = open(o);
  const BenchQuery q = make_query(client, o);
  report.url = client.url();
  report.bodies = client.scene().bodies.size();
  report.configurations = o.configurations;
  report.moved_bodies = q.bodies.size();
  report.reduce = o.reduce;
  report.precision = o.precision;
  report.warmup_s = o.warmup_s;
  report.command = o.command;
  {
    const Reply reply = client.distances(q.query);
    report.backend = reply.backend();
    report.pairs = reply.pairs();
    report.size = size_of(q.query, reply);
  }
  const std::unique_ptr<Floor> floor = open_floor(report.url, report.size);
  if (o.output == Output::kTable)
    std::cerr << "measuring for about " << (1 + 2 * kFloorPart) * o.seconds + (1 + kFloorPart) * o.warmup_s
              << " s ...\n";
  measure(client, q.query, *floor, o, report);
  report.floor_description = floor->description();
  print_report(report, std::cout, o.output);
  if (!o.csv.empty()) append_csv(report, o.csv);
}

/// The command line, as a shell would take it again; priority and pinning, which a latency depends on, are part of it.
std::string command_line(const CLI::App& command) {
  std::string line;
  if (const int nice = ::getpriority(PRIO_PROCESS, 0); nice != 0) line += "nice -n " + std::to_string(nice) + " ";
  cpu_set_t cpus;
  const long online = ::sysconf(_SC_NPROCESSORS_ONLN);
  if (::sched_getaffinity(0, sizeof cpus, &cpus) == 0 && CPU_COUNT(&cpus) < online) {
    std::string list;
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
      if (CPU_ISSET(cpu, &cpus)) list += (list.empty() ? "" : ",") + std::to_string(cpu);
    line += "taskset -c " + list + " ";
  }
  line += "clearance bench";
  for (const CLI::Option* option : command.get_options())
    for (const std::string& value : option->results())
      if (option->get_name() != "--csv" && option->get_name() != "--help")
        line += " " + option->get_name() + (option->get_items_expected_max() == 0 ? "" : " " + value);
  return line;
}

}  // namespace

void add_bench(CLI::App& app) {
  auto& command = *app.add_subcommand("bench", "how long queries take, beside the bare transport");
  auto options = std::make_shared<Options>();
  add_connection_options(command, options->connection);
  command.add_option("--pairs", options->pairs, "pairs drawn from the scene's; 0: all enabled pairs")
      ->type_name("N")
      ->capture_default_str();
  command
      .add_option("--configs", options->configurations,
                  "configurations of --moved bodies around their current poses;\n0: the current poses")
      ->check(quiet(CLI::Range(0u, 10'000'000u)))
      ->type_name("K")
      ->capture_default_str();
  command.add_option("--moved", options->moved, "bodies that a configuration moves")
      ->check(quiet(CLI::Range(1u, 100'000u)))
      ->type_name("M")
      ->capture_default_str();
  command.add_option("--jitter", options->jitter_m, "how far they move: metres and radians, standard deviation")
      ->check(quiet(CLI::Range(0.0, 1e6)))
      ->type_name("S")
      ->capture_default_str();
  command.add_option("--seed", options->seed, "of the pairs and configurations drawn")
      ->type_name("N")
      ->capture_default_str();
  command.add_option("--rate", options->rate, "requests a second, or \"closed\": each after the last reply")
      ->type_name("HZ|closed")
      ->capture_default_str();
  command.add_option("--seconds", options->seconds, "how long to measure")
      ->check(quiet(CLI::Range(0.01, 86400.0)))
      ->type_name("S")
      ->capture_default_str();
  command.add_option("--warmup", options->warmup_s, "how long to run before that")
      ->check(quiet(CLI::Range(0.0, 86400.0)))
      ->type_name("S")
      ->capture_default_str();
  command
      .add_option("--spin-us", options->spin_us,
                  "microseconds that the client polls before it sleeps (shared memory);\n0: none; default 20")
      ->check(quiet(CLI::Range(0, 1'000'000)))
      ->type_name("N");
  command.add_option("--precision", options->precision, "f64, f32")
      ->check(quiet(CLI::IsMember({"f64", "f32"})))
      ->type_name("WORD")
      ->capture_default_str();
  command.add_option("--reduce", options->reduce, "none, within (--max-distance), nearest, min")
      ->check(quiet(CLI::IsMember({"none", "within", "nearest", "min"})))
      ->type_name("WORD")
      ->capture_default_str();
  command
      .add_option("--max-distance", options->max_distance, "pairs proved farther than so many metres are \"beyond\"")
      ->check(quiet(CLI::NonNegativeNumber))
      ->type_name("M");
  command.add_option("--csv", options->csv, "add a row to this file")->type_name("FILE");
  command.add_flag_callback(
      "--json", [options] { options->output = Output::kJson; }, "print JSON");
  command.callback([options, &command] {
    options->command = command_line(command);
    run(*options);
  });

  // The floor's other process; not for people.
  auto& echo = *app.add_subcommand("bench-echo")->group("");
  auto arguments = std::make_shared<std::vector<std::string>>();
  echo.add_option("arguments", *arguments);
  echo.callback([arguments] {
    if (run_echo(*arguments) != 0) throw std::runtime_error("bench-echo: ended");
  });
}

}  // namespace clearance::cli
