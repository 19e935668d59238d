// clearance bench: latency of queries, and the share of the bare transport.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "bench/latency/bench_floor.h"
#include "bench/latency/bench_query.h"
#include "bench/latency/bench_report.h"
#include "bench/latency/bench_samples.h"
#include "cli/commands.h"
#include "wire/default_socket.h"
#include "wire/protocol.h"
#include "wire/wire.h"

namespace clearance::cli {

namespace {

/// Number of rounds that alternate between baseline and daemon, so that other load affects both.
constexpr int kRounds = 5;
/// Time spent on each of the two baselines, relative to the time spent on the daemon.
constexpr double kFloorPart = 0.5;
/// Consecutive lost replies after which the daemon counts as gone.
constexpr int kMostLost = 20;

struct BenchOptions : BenchQueryOptions {
  Connection connection;
  Output output = Output::kTable;
  std::string rate = "closed";
  double seconds = 5, warmup_s = 1;
  int spin_us = -1;  ///< -1 for the value in the URL
  std::string csv;
  std::string command;  ///< as typed
};

EchoSize size_of(const Query& query, const Result& reply) {
  const std::uint64_t configurations = query.bodies.empty() ? 0 : query.configurations.size() / query.bodies.size();
  return {
      sizeof(wire::FrameHeader) + wire::query_payload_bytes(query.pairs.size(), query.bodies.size(), configurations),
      sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader) + wire::columns_bytes(reply.rows(), reply.fields())};
}

/// Alternates between daemon and baseline and fills the report's series.
void measure(Client& client, const Query& query, Floor& floor, const BenchOptions& o, BenchReport& report) {
  int lost_in_a_row = 0;
  const auto evaluate = [&]() -> Exchanged {
    try {
      const Result reply = client.distances(query);
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
  drive(evaluate, report.rate_hz, o.warmup_s, warm);
  if (warm.engine.size() == 0) drive(evaluate, 0, 0.01, warm);
  report.held = std::chrono::nanoseconds(std::llround(1e3 * warm.engine.percentile_us(0.5)));
  drive_floor({}, o.warmup_s * kFloorPart, cold);
  for (int round = 0; round < kRounds; ++round) {
    drive_floor({}, o.seconds * kFloorPart / kRounds, report.floor);
    drive_floor(report.held, o.seconds * kFloorPart / kRounds, report.held_floor);
    drive(evaluate, report.rate_hz, o.seconds / kRounds, report.ours);
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

/// Connects, with the spin time of `--spin-us`.
Client open(const BenchOptions& o) {
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

void run(const BenchOptions& o) {
  BenchReport report;
  report.rate_hz = parse_rate(o.rate);
  if (!o.csv.empty()) check_csv(row_of(report), o.csv);
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
    const Result reply = client.distances(q.query);
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
  if (!o.csv.empty()) append_csv(row_of(report), o.csv);
}

}  // namespace

void add_bench(CLI::App& app) {
  auto& command =
      *app.add_subcommand("bench", "how long queries take, compared with the bare transport; modes: throughput, loop");
  auto options = std::make_shared<BenchOptions>();
  add_connection_options(command, options->connection);
  add_query_options(command, *options);
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
                  "microseconds that the client polls before it sleeps (shared memory);\n0 for none; default 20")
      ->check(quiet(CLI::Range(0, 1'000'000)))
      ->type_name("N");
  command.add_option("--csv", options->csv, "add a row to this file")->type_name("FILE");
  command.add_flag_callback("--json", [options] { options->output = Output::kJson; }, "print JSON");
  add_throughput_mode(command);
#ifdef CLEARANCE_HAVE_LCM
  add_loop_mode(command);
#endif
  command.callback([options, &command] {
    if (!command.get_subcommands().empty()) return;
    options->command = bench_command_line(command);
    run(*options);
  });

  // The baseline's other process; hidden from help.
  auto& echo = *app.add_subcommand("bench-echo")->group("");
  auto arguments = std::make_shared<std::vector<std::string>>();
  echo.add_option("arguments", *arguments);
  echo.callback([arguments] {
    if (run_echo(*arguments) != 0) throw std::runtime_error("bench-echo: ended");
  });
}

}  // namespace clearance::cli
