// clearance bench loop: a control loop at a fixed rate that sends poses over LCM and receives distances, compared with
// an idle loop.
#include <stdlib.h>

#include <chrono>
#include <clearance_lcm/pose_update_t.hpp>
#include <cstdio>
#include <iostream>
#include <memory>
#include <thread>

#include "bench/latency/bench_query.h"
#include "bench/latency/bench_report.h"
#include "bench/latency/bench_samples.h"
#include "cli/commands.h"
#include "cli/machine_name.h"
#include "wire/lcm/lcm_bus.h"
#include "wire/protocol.h"

namespace clearance::cli {
namespace {

using Clock = std::chrono::steady_clock;

/// Durations of the alternating working and idle loops; they alternate so that other load affects both.
constexpr double kWorkS = 8, kIdleS = 2;
/// Sets of poses that are published in turn.
constexpr int kPoseSets = 64;

struct ControlLoopOptions : BenchQueryOptions {
  Connection connection;
  std::string lcm;
  double minutes = 1, rate_hz = 1000;
  std::int64_t wait_us = 0;
  std::string csv, command;
};

/// Statistics of the cycles of one loop.
struct Cycles {
  Samples done;               ///< from a cycle's due time to its end
  std::uint64_t late = 0;     ///< ended after the next cycle was due
  std::uint64_t skipped = 0;  ///< never started, because an earlier cycle was still running
  double seconds = 0;

  std::uint64_t misses() const { return late + skipped; }
  std::uint64_t cycles() const { return done.size() + skipped; }
};

/// Runs `work` at every multiple of the period for a given time, sleeping in between.
template <class Work>
void run_cycles(double seconds, std::chrono::nanoseconds period, Cycles& cycles, Work work) {
  const auto begin = Clock::now() + period;
  const auto count = static_cast<std::int64_t>(seconds * 1e9 / static_cast<double>(period.count()));
  for (std::int64_t i = 0; i < count && !cycles.done.full();) {
    const auto due = begin + i * period;
    std::this_thread::sleep_until(due);
    work();
    const auto took = Clock::now() - due;
    cycles.done.add(std::chrono::nanoseconds(took).count());
    if (took > period) ++cycles.late;
    const std::int64_t next = std::max<std::int64_t>(i + 1, (Clock::now() - begin) / period);
    cycles.skipped += static_cast<std::uint64_t>(std::min(next, count) - (i + 1));
    i = next;
  }
  cycles.seconds += seconds;
}

/// Publishes poses of all movable bodies and queries distances, as a controller does in each cycle.
class Controller {
 public:
  Controller(Client& client, const ControlLoopOptions& o)
      : client_(client), query_(make_query(client, o)), bus_(parse_lcm_address(o.lcm)), wait_ns_(1000 * o.wait_us) {
    const std::vector<BodyStateInfo> states = client.body_states();
    const std::vector<std::uint32_t> bodies = movable_bodies(client.scene(), states);
    if (bodies.empty()) throw std::invalid_argument("bench loop: the scene has no body that can be moved");
    std::mt19937_64 random(o.seed);
    message_.publisher_id = draw_lcm_id();
    message_.count = static_cast<std::int32_t>(bodies.size());
    for (const std::uint32_t body : bodies) message_.names.push_back(client.scene().bodies[body].name);
    for (auto& set : sets_)
      for (const std::uint32_t body : bodies) {
        const Pose7 pose = jittered(states[body].pose, o.jitter_m, random);
        set.emplace_back(pose.begin(), pose.end());
      }
    message_.poses = sets_[0];
    if (const int bytes = message_.getEncodedSize(); bytes > static_cast<int>(kLcmMessageBytes))
      throw std::invalid_argument("bench loop: the poses of " + std::to_string(bodies.size()) + " bodies take " +
                                  std::to_string(bytes) + " bytes; a message has at most " +
                                  std::to_string(kLcmMessageBytes));
  }

  void cycle() {
    message_.poses = sets_[message_.sequence % kPoseSets];
    ++message_.sequence;
    message_.stamp_ns = Clock::now().time_since_epoch().count();
    if (!bus_.publish_message("CLEARANCE_POSES", message_)) ++unsent_;
    if (wait_ns_ > 0) {
      query_.query.min_pose_stamp_ns = message_.stamp_ns;
      query_.query.deadline_ns = wait_ns_;
    }
    try {
      take(client_.distances(query_.query));
    } catch (const RequestError& error) {
      const auto code = static_cast<wire::ErrorCode>(error.code);
      if (code != wire::ErrorCode::kPosesLate && code != wire::ErrorCode::kDeadline) throw;
      ++late_poses_;
    }
  }

  std::size_t bodies() const { return message_.names.size(); }
  std::uint64_t pairs() const { return pairs_; }
  std::uint64_t fresh() const { return fresh_; }
  std::uint64_t unsent() const { return unsent_; }
  std::uint64_t late_poses() const { return late_poses_; }
  const Samples& engine() const { return engine_; }

 private:
  void take(const Result& reply) {
    if (reply.snapshot_stamp_ns() == message_.stamp_ns) ++fresh_;
    engine_.add(static_cast<std::int64_t>(reply.engine_ns()));
    pairs_ = reply.pairs();
  }

  Client& client_;
  BenchQuery query_;
  LcmBus bus_;
  clearance_lcm::pose_update_t message_{};
  std::vector<std::vector<double>> sets_[kPoseSets];
  std::uint64_t fresh_ = 0;       ///< answers that used the poses of their own cycle instead of earlier ones
  std::uint64_t unsent_ = 0;      ///< messages that the system did not accept
  std::uint64_t late_poses_ = 0;  ///< cycles without an answer, because their poses arrived too late
  std::int64_t wait_ns_;
  std::uint64_t pairs_ = 0;
  Samples engine_;
};

Table result_of(const ControlLoopOptions& o, const std::string& url, const Controller& controller,
                const Cycles& working, const Cycles& idle) {
  double load[1] = {0};
  ::getloadavg(load, 1);
  std::vector<std::string> names{"machine", "date", "load_1min", "transport", "bodies", "pairs", "rate_hz"};
  std::vector<Cell> cells{machine_name(),      utc_now(),          rounded(load[0]), transport_name(url),
                          controller.bodies(), controller.pairs(), o.rate_hz};
  const auto add = [&](const std::string& prefix, const Cycles& c) {
    const double per_100k =
        1e5 * static_cast<double>(c.misses()) / static_cast<double>(std::max<std::uint64_t>(c.cycles(), 1));
    names.insert(names.end(), {prefix + "seconds", prefix + "cycles", prefix + "misses", prefix + "misses_per_100k",
                               prefix + "p50_us", prefix + "p99_us", prefix + "p99.9_us", prefix + "max_us"});
    cells.insert(cells.end(),
                 {rounded(c.seconds), c.cycles(), c.misses(), rounded(per_100k), rounded(c.done.percentile_us(0.5)),
                  rounded(c.done.percentile_us(0.99)), rounded(c.done.percentile_us(0.999)), rounded(c.done.max_us())});
  };
  add("", working);
  add("idle_", idle);
  names.insert(names.end(), {"engine_p50_us", "wait_us", "fresh_answers", "late_poses", "unsent_poses", "command"});
  cells.insert(cells.end(), {rounded(controller.engine().percentile_us(0.5)), o.wait_us, controller.fresh(),
                             controller.late_poses(), controller.unsent(), o.command});
  Table table(names);
  table.add(std::move(cells));
  return table;
}

void run(const ControlLoopOptions& o) {
  Client client = o.connection.open();
  Controller controller(client, o);
  Cycles working, idle, warm;
  const std::chrono::nanoseconds period(std::llround(1e9 / o.rate_hz));
  if (!o.csv.empty()) check_csv(result_of(o, client.url(), controller, working, idle), o.csv);
  std::cerr << "running for about " << o.minutes * (1 + kIdleS / kWorkS) << " minutes ...\n";
  const auto work = [&] { controller.cycle(); };
  run_cycles(0.5, period, warm, work);
  for (double left = 60 * o.minutes; left > 0; left -= kWorkS) {
    const double part = std::min(left, kWorkS);
    run_cycles(part, period, working, work);
    run_cycles(part * kIdleS / kWorkS, period, idle, [] {});
  }
  std::printf("%s and %s, %zu bodies moved and %llu pairs asked for in each cycle, %g cycles a second\n\n",
              client.url().c_str(), o.lcm.c_str(), controller.bodies(),
              static_cast<unsigned long long>(controller.pairs()), o.rate_hz);
  std::fflush(stdout);
  Table table({"loop", "cycles", "deadline misses", "of 100,000", "p50 [us]", "p99 [us]", "p99.9 [us]", "max [us]"});
  const auto add = [&](const char* name, const Cycles& c) {
    table.add({name, c.cycles(), c.misses(),
               Cell(1e5 * static_cast<double>(c.misses()) / static_cast<double>(c.cycles()), 4),
               Cell(c.done.percentile_us(0.5), 4), Cell(c.done.percentile_us(0.99), 4),
               Cell(c.done.percentile_us(0.999), 4), Cell(c.done.max_us(), 4)});
  };
  add("poses out, distances back", working);
  add("idle, by turns", idle);
  table.print(std::cout, Output::kTable);
  std::cout
      << "\nfrom the moment a cycle was due to its end; a miss: it ended after the next one was due, or did not begin\n"
      << controller.fresh() << " answers saw the poses of their own cycle, the others those of an earlier one; "
      << controller.late_poses() << " cycles had none, since their poses came too late\n";
  if (!o.csv.empty()) append_csv(result_of(o, client.url(), controller, working, idle), o.csv);
}

}  // namespace

void add_loop_mode(CLI::App& bench) {
  auto& command =
      *bench.add_subcommand("loop", "a control loop's deadline misses, compared with those of an idle loop");
  auto options = std::make_shared<ControlLoopOptions>();
  options->pairs = 200;
  add_connection_options(command, options->connection);
  command
      .add_option("--lcm", options->lcm, "where the daemon follows poses, as in \"udpm://239.255.76.67:7667?ttl=0\"")
      ->type_name("URL")
      ->required();
  command.add_option("--minutes", options->minutes, "of the loop; a quarter more for the idle one")
      ->check(quiet(CLI::Range(0.001, 1e4)))
      ->type_name("M")
      ->capture_default_str();
  command.add_option("--rate", options->rate_hz, "cycles a second")
      ->check(quiet(CLI::Range(1.0, 20'000.0)))
      ->type_name("HZ")
      ->capture_default_str();
  command
      .add_option("--wait-us", options->wait_us, "maximum wait for the poses of its own cycle; 0 to use those present")
      ->check(quiet(CLI::Range(0, 10'000'000)))
      ->type_name("N")
      ->capture_default_str();
  add_query_options(command, *options);
  command.add_option("--csv", options->csv, "add a row to this file")->type_name("FILE");
  command.callback([options, &bench, &command] {
    expect_mode_first(bench);
    options->command = bench_command_line(command);
    run(*options);
  });
}

}  // namespace clearance::cli
