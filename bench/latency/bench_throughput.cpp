// clearance bench throughput: queries per second of one client and of several concurrent ones, and large replies
// compared with a memcpy of the same size.
#include <algorithm>
#include <atomic>
#include <barrier>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <iostream>
#include <memory>
#include <thread>
#include <utility>

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

/// A client's replies. One is lost after the client's timeout.
struct Replies {
  std::uint64_t answers = 0, lost = 0;
};

struct Throughput {
  std::vector<Replies> clients;
  double seconds = 0;
  std::uint64_t pairs = 0, request_bytes = 0, reply_bytes = 0;
  Samples latency, engine;
  Samples copy;  ///< one memcpy of a reply's bytes, alternating with the queries of the first client
  Replies total() const {
    Replies sum;
    for (const Replies& of_one : clients) sum.answers += of_one.answers, sum.lost += of_one.lost;
    return sum;
  }
  std::pair<std::uint64_t, std::uint64_t> least_and_most() const {
    const auto fewer = [](const Replies& a, const Replies& b) { return a.answers < b.answers; };
    const auto [least, most] = std::minmax_element(clients.begin(), clients.end(), fewer);
    return clients.empty() ? std::pair<std::uint64_t, std::uint64_t>() : std::pair(least->answers, most->answers);
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

/// One client's closed loop, with `depth` outstanding requests. Returns the answers until `stop`, and all lost replies.
/// \param samples null for no times
Replies drive_client(Client& client, const Query& query, int depth, const std::atomic<bool>& stop,
                     Throughput* samples) {
  Replies replies;
  const auto count = [&](const auto& wait) {
    try {
      wait();
      replies.answers += !stop.load(std::memory_order_relaxed);
      return true;
    } catch (const TimeoutError&) {  // over LCM
      ++replies.lost;
      return false;
    }
  };
  if (depth > 1) {
    std::vector<Pending> under_way;
    for (int i = 0; i < depth; ++i) under_way.push_back(client.submit(query));
    for (std::size_t next = 0; !stop.load(std::memory_order_relaxed); next = (next + 1) % under_way.size()) {
      count([&] { (void)under_way[next].get(); });
      under_way[next] = client.submit(query);
    }
    for (Pending& last : under_way) count([&] { (void)last.get(); });
    return replies;
  }
  std::unique_ptr<Copier> copier;
  if (samples) copier = std::make_unique<Copier>(samples->reply_bytes);
  while (!stop.load(std::memory_order_relaxed)) {
    const auto begin = Clock::now();
    std::uint64_t engine_ns = 0;
    const bool is_answered = count([&] { engine_ns = client.distances(query).engine_ns(); });
    if (!is_answered || !samples || samples->latency.full()) continue;
    samples->latency.add(ns_since(begin));
    samples->engine.add(static_cast<std::int64_t>(engine_ns));
    const auto copy = Clock::now();
    copier->copy();
    samples->copy.add(ns_since(copy));
  }
  return replies;
}

Throughput measure(const ThroughputOptions& o) {
  Throughput result;
  result.clients.resize(static_cast<std::size_t>(o.clients));
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
        result.clients[i] =
            drive_client(clients[i], queries[i].query, o.depth, stop, clients.size() == 1 ? &result : nullptr);
      } catch (...) {
        failures[i] = std::current_exception();
      }
    });
  start.arrive_and_wait();
  const auto begin = Clock::now();
  std::this_thread::sleep_for(std::chrono::duration<double>(o.seconds));
  stop = true;
  result.seconds = 1e-9 * static_cast<double>(ns_since(begin));
  threads.clear();
  for (const auto& failure : failures)
    if (failure) std::rethrow_exception(failure);
  return result;
}

Table row_of(const ThroughputOptions& o, const std::string& url, const Throughput& r) {
  const auto [least, most] = r.least_and_most();
  const double per_second = r.seconds > 0 ? static_cast<double>(r.total().answers) / r.seconds : 0;
  const double outside = r.latency.percentile_us(0.5) - r.engine.percentile_us(0.5);
  const auto gb_per_s = [&](double us) {
    return rounded(us > 0 ? 1e-3 * static_cast<double>(r.reply_bytes) / us : std::nan(""));
  };
  Table table({"machine", "date", "transport", "clients", "depth", "pairs", "reply_bytes", "queries_per_s",
               "pairs_per_s", "least_of_a_client", "most_of_a_client", "lost", "p50_us", "engine_p50_us",
               "outside_engine_p50_us", "memcpy_p50_us", "memcpy_gb_per_s", "command"});
  table.add({machine_name(), utc_now(), transport_name(url), o.clients, o.depth, r.pairs, r.reply_bytes,
             rounded(per_second), rounded(per_second * static_cast<double>(r.pairs)), least, most, r.total().lost,
             rounded(r.latency.percentile_us(0.5)), rounded(r.engine.percentile_us(0.5)), rounded(outside),
             rounded(r.copy.percentile_us(0.5)), gb_per_s(r.copy.percentile_us(0.5)), o.command});
  return table;
}

void run(const ThroughputOptions& o) {
  const std::string url = o.connection.open().url();
  if (!o.csv.empty()) check_csv(row_of(o, url, {}), o.csv);
  const Throughput r = measure(o);
  const auto [least, most] = r.least_and_most();
  std::printf("%s, %s\n%d client%s, %d request%s of %llu pairs under way in each, replies of %llu bytes, %.1f s\n\n",
              url.c_str(), machine_name().c_str(), o.clients, o.clients > 1 ? "s" : "", o.depth, o.depth > 1 ? "s" : "",
              static_cast<unsigned long long>(r.pairs), static_cast<unsigned long long>(r.reply_bytes), r.seconds);
  const double per_second = static_cast<double>(r.total().answers) / r.seconds;
  std::printf(
      "%.0f queries a second, %.4g pairs a second, %.4g GB of replies a second; each client %llu to %llu; %llu replies "
      "lost\n",
      per_second, per_second * static_cast<double>(r.pairs), 1e-9 * per_second * static_cast<double>(r.reply_bytes),
      static_cast<unsigned long long>(least), static_cast<unsigned long long>(most),
      static_cast<unsigned long long>(r.total().lost));
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
