// clearance stat: the daemon's counters, once, repeatedly with rates or in Prometheus' format; times of echoes.
#include <algorithm>
#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <thread>

#include "cli/commands.h"
#include "wire/prometheus.h"

namespace clearance::cli {
namespace {

using Counters = std::map<std::string, std::uint64_t>;

struct StatOptions {
  Connection connection;
  Output output = Output::kTable;
  double watch_s = 0;
  std::uint64_t count = 0;
  bool prometheus = false;
  unsigned echoes = 0;
};

void print_echoes(Client& client, unsigned count) {
  const std::vector<std::byte> payload(64);
  std::vector<double> us;
  for (unsigned i = 0; i < count; ++i) us.push_back(1e-3 * static_cast<double>(client.ping(payload).count()));
  std::sort(us.begin(), us.end());
  const auto at = [&us](double part) {
    return us[std::min(us.size() - 1, static_cast<std::size_t>(part * static_cast<double>(us.size())))];
  };
  std::printf("%s: %u echoes of %zu bytes, round trip min %.1f us, p50 %.1f us, p99 %.1f us, max %.1f us\n",
              client.url().c_str(), count, payload.size(), us.front(), at(0.5), at(0.99), us.back());
}

/// Returns the latencies of queries that were answered between two readings.
Latencies latencies_between(const Counters& before, const Counters& now) {
  std::vector<std::pair<std::string, std::uint64_t>> grown;
  for (const auto& [name, value] : now) {
    const auto old = before.find(name);
    grown.emplace_back(name, value - (old == before.end() ? 0 : std::min(value, old->second)));
  }
  return latencies_of(grown);
}

/// Returns the least bound of a share of the latencies, from 0 to 1; none if there are none.
Cell quantile(const Latencies& all, double part) {
  std::uint64_t total = 0, sum = 0;
  for (const auto& [bound, count] : all) total += count;
  if (total == 0) return {};
  for (const auto& [bound, count] : all) {
    sum += count;
    if (static_cast<double>(sum) >= part * static_cast<double>(total)) return bound ? Cell(*bound) : Cell("more");
  }
  return {};
}

void print(const Counters& now, const Counters& before, double seconds, Output output) {
  const bool rates = seconds > 0;
  Table table(rates ? std::vector<std::string>{"counter", "value", "per_s"}
                    : std::vector<std::string>{"counter", "value"});
  for (const auto& [name, value] : now) {
    if (name.rfind(kLatencyCounters, 0) == 0 && output == Output::kTable) continue;  // tables show quantiles instead
    std::vector<Cell> row{name, value};
    if (rates) {
      const auto old = before.find(name);
      const double grown = static_cast<double>(value) - static_cast<double>(old == before.end() ? 0 : old->second);
      row.push_back(grown == 0 ? Cell() : Cell(grown / seconds, 4));
    }
    table.add(std::move(row));
  }
  const Latencies all = latencies_between(before, now);
  for (const auto& [name, part] : {std::pair{"latency_us, half at most", 0.5},
                                   {"latency_us, 99 % at most", 0.99},
                                   {"latency_us, all at most", 1.0}}) {
    if (output != Output::kTable) break;
    std::vector<Cell> row{name, quantile(all, part)};
    if (rates) row.push_back({});
    table.add(std::move(row));
  }
  table.print(std::cout, output);
}

Counters counters_of(Client& client) {
  Counters counters;
  for (const auto& [name, value] : client.stats()) counters[name] = value;
  return counters;
}

void stat(const StatOptions& o) {
  Client client = o.connection.open();
  if (o.echoes > 0) return print_echoes(client, o.echoes);
  if (o.prometheus) {
    std::cout << prometheus_text(client.stats());
    return;
  }
  if (o.watch_s == 0) return print(counters_of(client), {}, 0, o.output);
  using Clock = std::chrono::steady_clock;
  Counters before = counters_of(client);
  auto then = Clock::now();
  for (std::uint64_t i = 0; o.count == 0 || i < o.count; ++i) {
    std::this_thread::sleep_until(
        then + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(o.watch_s)));
    const auto now = Clock::now();
    Counters counters = counters_of(client);
    if (o.output == Output::kTable && i > 0) std::cout << '\n';
    print(counters, before, std::chrono::duration<double>(now - then).count(), o.output);
    if (!std::cout.flush()) return;  // the reader has closed the pipe
    before = std::move(counters);
    then = now;
  }
}

}  // namespace

void add_stat(CLI::App& app) {
  auto& command = *app.add_subcommand("stat", "the daemon's counters, and how long queries take");
  auto options = std::make_shared<StatOptions>();
  add_connection_options(command, options->connection);
  add_output_options(command, options->output);
  auto* watch = command
                    .add_option("--watch", options->watch_s,
                                "print again every so many seconds (1 by default), with rates per second")
                    ->check(quiet(CLI::Range(0.01, 86400.0)))
                    ->expected(0, 1)
                    ->default_str("1")
                    ->type_name("[SECONDS]");
  command.add_option("--count", options->count, "number of repetitions; default: until stopped")
      ->needs(watch)
      ->type_name("N");
  command.add_flag("--prometheus", options->prometheus, "print Prometheus' text format")->excludes(watch);
  auto* ping =
      command.add_option("--ping", options->echoes, "time so many echoes through the daemon instead (100 by default)")
          ->check(quiet(CLI::Range(1u, 100000000u)))
          ->expected(0, 1)
          ->default_str("100")
          ->type_name("[N]")
          ->excludes(watch);
  for (const char* other : {"--json", "--csv", "--prometheus"}) ping->excludes(command.get_option(other));
  command.callback([options] { stat(*options); });
}

}  // namespace clearance::cli
