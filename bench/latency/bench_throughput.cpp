// clearance bench throughput: queries per second of one client and of several concurrent ones, and large replies
// compared with a memcpy of the same size.
#include <atomic>
#include <barrier>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <iostream>
#include <memory>
#include <thread>

#include "bench/latency/bench_floor.h"
#include "bench/latency/bench_query.h"
#include "bench/latency/bench_report.h"
#include "bench/latency/bench_samples.h"
#include "cli/commands.h"
#include "cli/machine_name.h"
#include "wire/protocol.h"
#include "wire/wire.h"

namespace clearance::cli {
namespace {

using Clock = std::chrono::steady_clock;

struct ThroughputOptions : BenchQueryOptions {
  Connection connection;
  int clients = 1;
  int depth = 1;
  double seconds = 5;
  std::string csv, command;
};

struct Throughput {
  std::vector<std::uint64_t> answers;  ///< for each client
  double seconds = 0;
  std::uint64_t pairs = 0, request_bytes = 0, reply_bytes = 0;
  Samples latency, engine;
  Samples copy;  ///< one memcpy of a reply's bytes, alternating with the queries of the first client
  std::uint64_t total() const {
    std::uint64_t sum = 0;
    for (const std::uint64_t n : answers) sum += n;
    return sum;
  }
};

std::int64_t ns_since(Clock::time_point begin) {
  return std::chrono::nanoseconds(Clock::now() - begin).count();
}

/// Copies a reply's bytes between two touched buffers.
class Copier {
 public:
  explicit Copier(std::uint64_t bytes) : from_(bytes, std::byte{1}), to_(bytes) {}
  void copy() {
    std::memcpy(to_.data(), from_.data(), to_.size());
    asm volatile("" : : "r"(to_.data()) : "memory");
  }

 private:
  std::vector<std::byte> from_, to_;
};

/// One client's closed loop, with `depth` outstanding requests.
std::uint64_t drive_client(Client& client, const Query& query, int depth, const std::atomic<bool>& stop,
                           Throughput* samples) {
  std::uint64_t answers = 0;
  if (depth > 1) {
    std::vector<Pending> under_way;
    for (int i = 0; i < depth; ++i) under_way.push_back(client.submit(query));
    for (std::size_t next = 0; !stop.load(std::memory_order_relaxed); next = (next + 1) % under_way.size()) {
      (void)under_way[next].get();
      under_way[next] = client.submit(query);
      ++answers;
    }
    for (Pending& last : under_way) (void)last.get();
    return answers;
  }
  std::unique_ptr<Copier> copier;
  if (samples) copier = std::make_unique<Copier>(samples->reply_bytes);
  while (!stop.load(std::memory_order_relaxed)) {
    const auto begin = Clock::now();
    const Result reply = client.distances(query);
    ++answers;
    if (!samples || samples->latency.full()) continue;
    samples->latency.add(ns_since(begin));
    samples->engine.add(static_cast<std::int64_t>(reply.engine_ns()));
    const auto copy = Clock::now();
    copier->copy();
    samples->copy.add(ns_since(copy));
  }
  return answers;
}

Throughput measure(const ThroughputOptions& o) {
  Throughput result;
  result.answers.resize(static_cast<std::size_t>(o.clients));
  std::vector<Client> clients;
  for (int i = 0; i < o.clients; ++i) clients.push_back(o.connection.open());
  // Each client draws its own pairs.
  std::vector<BenchQuery> queries;
  for (int i = 0; i < o.clients; ++i) {
    BenchQueryOptions own = o;
    own.seed += static_cast<std::uint64_t>(i);
    queries.push_back(make_query(clients[static_cast<std::size_t>(i)], own));
  }
  {
    const Result reply = clients[0].distances(queries[0].query);
    result.pairs = reply.pairs() * reply.configurations();
    result.reply_bytes =
        sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader) + wire::columns_bytes(reply.rows(), reply.fields());
  }
  std::atomic<bool> stop{false};
  std::vector<std::exception_ptr> failures(clients.size());
  std::barrier start(o.clients + 1);
  std::vector<std::jthread> threads;
  for (std::size_t i = 0; i < clients.size(); ++i)
    threads.emplace_back([&, i] {
      start.arrive_and_wait();
      try {
        // With several clients the memcpy would take time from the others.
        result.answers[i] =
            drive_client(clients[i], queries[i].query, o.depth, stop, clients.size() == 1 ? &result : nullptr);
      } catch (...) {
        failures[i] = std::current_exception();
      }
    });
  start.arrive_and_wait();
  const auto begin = Clock::now();
  std::this_thread::sleep_for(std::chrono::duration<double>(o.seconds));
  stop = true;
  threads.clear();
  result.seconds = 1e-9 * static_cast<double>(ns_since(begin));
  for (const auto& failure : failures)
    if (failure) std::rethrow_exception(failure);
  return result;
}

Table row_of(const ThroughputOptions& o, const std::string& url, const Throughput& r) {
  const auto [least, most] = std::minmax_element(r.answers.begin(), r.answers.end());
  const double per_second = r.seconds > 0 ? static_cast<double>(r.total()) / r.seconds : 0;
  const double outside = r.latency.percentile_us(0.5) - r.engine.percentile_us(0.5);
  const auto gb_per_s = [&](double us) {
    return rounded(us > 0 ? 1e-3 * static_cast<double>(r.reply_bytes) / us : std::nan(""));
  };
  Table table({"machine", "date", "transport", "clients", "depth", "pairs", "reply_bytes", "queries_per_s",
               "pairs_per_s", "least_of_a_client", "most_of_a_client", "p50_us", "engine_p50_us",
               "outside_engine_p50_us", "memcpy_p50_us", "memcpy_gb_per_s", "command"});
  table.add({machine_name(), utc_now(), transport_name(url), o.clients, o.depth, r.pairs, r.reply_bytes,
             rounded(per_second), rounded(per_second * static_cast<double>(r.pairs)),
             least == r.answers.end() ? 0 : *least, most == r.answers.end() ? 0 : *most,
             rounded(r.latency.percentile_us(0.5)), rounded(r.engine.percentile_us(0.5)), rounded(outside),
             rounded(r.copy.percentile_us(0.5)), gb_per_s(r.copy.percentile_us(0.5)), o.command});
  return table;
}

void run(const ThroughputOptions& o) {
  const std::string url = o.connection.open().url();
  if (!o.csv.empty()) check_csv(row_of(o, url, {}), o.csv);
  const Throughput r = measure(o);
  const auto [least, most] = std::minmax_element(r.answers.begin(), r.answers.end());
  std::printf("%s, %s\n%d client%s, %d request%s of %llu pairs under way in each, replies of %llu bytes, %.1f s\n\n",
              url.c_str(), machine_name().c_str(), o.clients, o.clients > 1 ? "s" : "", o.depth, o.depth > 1 ? "s" : "",
              static_cast<unsigned long long>(r.pairs), static_cast<unsigned long long>(r.reply_bytes), r.seconds);
  const double per_second = static_cast<double>(r.total()) / r.seconds;
  std::printf("%.0f queries a second, %.4g pairs a second, %.4g GB of replies a second; each client %llu to %llu\n",
              per_second, per_second * static_cast<double>(r.pairs),
              1e-9 * per_second * static_cast<double>(r.reply_bytes), static_cast<unsigned long long>(*least),
              static_cast<unsigned long long>(*most));
  if (r.latency.size() > 0)
    std::printf(
        "medians: latency %.2f us, of it the engine's %.2f; outside the engine %.2f; memcpy of the same bytes %.2f "
        "(%.1f GB/s)\n",
        r.latency.percentile_us(0.5), r.engine.percentile_us(0.5),
        r.latency.percentile_us(0.5) - r.engine.percentile_us(0.5), r.copy.percentile_us(0.5),
        1e-3 * static_cast<double>(r.reply_bytes) / r.copy.percentile_us(0.5));
  std::fflush(stdout);
  if (!o.csv.empty()) append_csv(row_of(o, url, r), o.csv);
}

}  // namespace

void add_throughput_mode(CLI::App& bench) {
  auto& command = *bench.add_subcommand(
      "throughput", "queries a second of several clients at once; large replies compared with a memcpy");
  auto options = std::make_shared<ThroughputOptions>();
  add_connection_options(command, options->connection);
  command.add_option("--clients", options->clients, "connections, each with a thread of its own")
      ->check(quiet(CLI::Range(1, 1024)))
      ->type_name("N")
      ->capture_default_str();
  command.add_option("--depth", options->depth, "requests that each has under way")
      ->check(quiet(CLI::Range(1, 16)))
      ->type_name("N")
      ->capture_default_str();
  add_query_options(command, *options);
  command.add_option("--seconds", options->seconds, "how long to measure")
      ->check(quiet(CLI::Range(0.01, 86400.0)))
      ->type_name("S")
      ->capture_default_str();
  command.add_option("--csv", options->csv, "add a row to this file")->type_name("FILE");
  command.callback([options, &bench, &command] {
    expect_mode_first(bench);
    options->command = bench_command_line(command);
    run(*options);
  });
}

}  // namespace clearance::cli
