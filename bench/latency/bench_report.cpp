#include "bench/latency/bench_report.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <ostream>
#include <sstream>
#include <stdexcept>

#include "cli/machine_name.h"

namespace clearance::cli {
namespace {

struct Quantile {
  const char* name;
  double part;
};
constexpr Quantile kQuantiles[] = {{"p50", 0.5}, {"p90", 0.9}, {"p99", 0.99}, {"p99.9", 0.999}, {"max", 1}};

double ratio(const Samples& a, const Samples& b, double part) {
  return a.percentile_us(part) / b.percentile_us(part);
}

/// Excess of the median over the bare baseline's and the engine's own.
double added_us(const BenchReport& r) {
  return r.ours.latency.percentile_us(0.5) - r.floor.latency.percentile_us(0.5) - r.ours.engine.percentile_us(0.5);
}

void print_for_people(const BenchReport& r, std::ostream& out) {
  char line[256];
  out << r.url << ", backend " << r.backend << ", " << machine_name() << "\n";
  std::snprintf(line, sizeof line, "%zu bodies, %llu pairs", r.bodies, static_cast<unsigned long long>(r.pairs));
  out << line;
  if (r.configurations > 0)
    out << " in each of " << r.configurations << " configurations of " << r.moved_bodies << " bodies";
  else
    out << " at the current poses";
  out << ", reduce " << r.reduce << ", " << r.precision << "; request " << r.size.request_bytes << " bytes, reply "
      << r.size.reply_bytes << " bytes\n";
  if (r.rate_hz > 0)
    std::snprintf(line, sizeof line, "fixed rate %g Hz (latency from the moment a request was due)", r.rate_hz);
  else
    std::snprintf(line, sizeof line, "closed loop (one request at a time, the next as soon as the reply is there)");
  out << line;
  std::snprintf(line, sizeof line, ", %.1f s after %.1f s of warm-up\n\n", r.ours.seconds, r.warmup_s);
  out << line;

  std::vector<std::string> columns{"microseconds"};
  for (const Quantile& q : kQuantiles) columns.push_back(q.name);
  Table table(columns);
  const auto add = [&](const char* name, auto value) {
    std::vector<Cell> row{name};
    for (const Quantile& q : kQuantiles) row.push_back(Cell(value(q.part), 4));
    table.add(std::move(row));
  };
  const auto add_samples = [&](const char* name, const Samples& samples) {
    add(name, [&](double part) { return samples.percentile_us(part); });
  };
  add_samples("latency", r.ours.latency);
  add_samples("  server", r.ours.server);
  add_samples("    engine", r.ours.engine);
  add_samples("  transport", r.ours.transport);
  add_samples("floor", r.floor.latency);
  add_samples("floor + engine's time", r.held_floor.latency);
  add("transport / floor", [&](double part) { return ratio(r.ours.transport, r.floor.transport, part); });
  table.print(out, Output::kTable);

  const double floor = r.floor.latency.percentile_us(0.5), engine = r.ours.engine.percentile_us(0.5);
  std::snprintf(line, sizeof line, "\nmedians: floor %.3f + engine's own %.3f = %.3f; latency %.3f: added %.3f us\n",
                floor, engine, floor + engine, r.ours.latency.percentile_us(0.5), added_us(r));
  out << line;
  for (const Bar& bar : bars_of(r)) {
    std::snprintf(line, sizeof line, "%s: %.3f; at most %g: %s\n", bar.name.c_str(), bar.value, bar.limit,
                  bar.met() ? "met" : "not met");
    out << line;
  }
  std::snprintf(line, sizeof line, "\n%zu answers, %.0f a second, %.3g pairs a second; %llu lost\n",
                r.ours.latency.size(), r.ours.throughput(),
                r.ours.throughput() * static_cast<double>(r.pairs) *
                    static_cast<double>(std::max<std::uint64_t>(r.configurations, 1)),
                static_cast<unsigned long long>(r.ours.lost));
  out << line;
  std::snprintf(line, sizeof line,
                "floor: the same bytes, bare: %s; %zu echoes, and %zu held for %.3f us as by the engine; %llu lost\n",
                r.floor_description.c_str(), r.floor.latency.size(), r.held_floor.latency.size(),
                1e-3 * static_cast<double>(r.held.count()),
                static_cast<unsigned long long>(r.floor.lost + r.held_floor.lost));
  out << line;
  if (r.ours.unsent > 0)
    out << r.ours.unsent << " requests more were due: the daemon does not keep up with this rate\n";
  if (r.ended_early) out << "ended early: " << Samples::kMost << " samples are the most that are kept\n";
}

}  // namespace

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

Cell rounded(double value) {
  Cell cell(value, 6);
  cell.exact = cell.text;
  return cell;
}

Table row_of(const BenchReport& r) {
  std::vector<std::string> names{"machine",     "date",    "transport", "backend",   "bodies",       "pairs",
                                 "configs",     "moved",   "reduce",    "precision", "mode",         "request_bytes",
                                 "reply_bytes", "samples", "lost",      "unsent",    "throughput_hz"};
  std::vector<Cell> cells{machine_name(),
                          utc_now(),
                          transport_name(r.url),
                          r.backend,
                          r.bodies,
                          r.pairs,
                          r.configurations,
                          r.moved_bodies,
                          r.reduce,
                          r.precision,
                          r.rate_hz > 0 ? Cell(r.rate_hz) : Cell("closed"),
                          r.size.request_bytes,
                          r.size.reply_bytes,
                          r.ours.latency.size(),
                          r.ours.lost,
                          r.ours.unsent,
                          rounded(r.ours.throughput())};
  const auto add = [&](const std::string& name, const Samples& samples, std::initializer_list<double> parts) {
    for (const Quantile& q : kQuantiles)
      for (const double part : parts)
        if (part == q.part) {
          names.push_back(name + q.name + "_us");
          cells.push_back(rounded(samples.percentile_us(part)));
        }
  };
  add("", r.ours.latency, {0.5, 0.9, 0.99, 0.999, 1});
  add("server_", r.ours.server, {0.5, 0.99});
  add("engine_", r.ours.engine, {0.5, 0.99});
  add("transport_", r.ours.transport, {0.5, 0.99});
  add("floor_", r.floor.latency, {0.5, 0.99, 0.999});
  add("held_floor_", r.held_floor.latency, {0.5, 0.99, 0.999});
  for (const double part : {0.5, 0.99}) {
    names.push_back(part == 0.5 ? "transport_to_floor_p50" : "transport_to_floor_p99");
    cells.push_back(rounded(ratio(r.ours.transport, r.floor.transport, part)));
  }
  names.push_back("added_p50_us");
  cells.push_back(rounded(added_us(r)));
  const std::vector<Bar> bars = bars_of(r);
  for (std::size_t i = 0; i < bars.size(); ++i) {
    const std::string prefix = i == 0 ? "p50_bar" : "p99.9_bar";
    names.insert(names.end(), {prefix, prefix + "_limit", prefix + "_met"});
    cells.insert(cells.end(), {rounded(bars[i].value), rounded(bars[i].limit), Cell(bars[i].met() ? "yes" : "no")});
  }
  names.push_back("command");
  cells.push_back(r.command);
  Table table(names);
  table.add(std::move(cells));
  return table;
}

std::string transport_name(const std::string& url) {
  const std::string scheme = url.substr(0, url.find(':'));
  if (scheme == "ipc" || scheme == "tcp") return "zmq-" + scheme;
  return scheme == "udpm" ? "lcm" : scheme;
}

std::vector<Bar> bars_of(const BenchReport& r) {
  constexpr double kAddedUs = 0.5, kToFloor = 1.2, kTailToFloor = 2;
  const double tail = ratio(r.ours.latency, r.held_floor.latency, 0.999);
  Bar median{"p50, added [us]", added_us(r), kAddedUs};
  if (transport_name(r.url) != "shm")
    median = {
        "p50, (latency - engine) / floor",
        (r.ours.latency.percentile_us(0.5) - r.ours.engine.percentile_us(0.5)) / r.floor.latency.percentile_us(0.5),
        kToFloor};
  return {median, {"p99.9, latency / (floor + engine's time)", tail, kTailToFloor}};
}

void print_report(const BenchReport& report, std::ostream& out, Output output) {
  if (output == Output::kTable)
    print_for_people(report, out);
  else
    row_of(report).print(out, output);
}

namespace {

/// Column names in the file; empty if the file is missing or empty.
std::string header_of(const std::string& path) {
  std::ifstream file(path);
  std::string header;
  std::getline(file, header);
  return header;
}

}  // namespace

void check_csv(const Table& row, const std::string& path) {
  std::ostringstream text;
  row.print(text, Output::kCsv);
  const std::string names = text.str().substr(0, text.str().find('\n'));
  const std::string header = header_of(path);
  if (!header.empty() && header != names)
    throw std::runtime_error(path + ": its columns are not those of this benchmark; choose another file");
  if (!std::ofstream(path, std::ios::app)) throw std::runtime_error(path + ": cannot write");
}

void append_csv(const Table& row, const std::string& path) {
  std::ostringstream text;
  row.print(text, Output::kCsv);
  const std::string both = text.str();
  const bool fresh = header_of(path).empty();
  std::ofstream file(path, std::ios::app);
  file << (fresh ? both : both.substr(both.find('\n') + 1));
  if (!file.flush()) throw std::runtime_error(path + ": cannot write");
}

}  // namespace clearance::cli
