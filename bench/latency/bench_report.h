// Results of a latency benchmark, as text and as a CSV row.
#pragma once

#include <chrono>
#include <iosfwd>
#include <string>
#include <vector>

#include "bench/latency/bench_floor.h"
#include "bench/latency/bench_samples.h"
#include "cli/table.h"

namespace clearance::cli {

struct BenchReport {
  std::string url, backend, command;
  std::size_t bodies = 0;            ///< in the scene
  std::uint64_t pairs = 0;           ///< of each configuration
  std::uint64_t configurations = 0;  ///< 0 for the current poses
  std::size_t moved_bodies = 0;
  std::string reduce, precision;
  double rate_hz = 0;  ///< 0 for a closed loop
  double warmup_s = 0;
  EchoSize size;
  Series ours, floor;
  Series held_floor;                 ///< baseline whose echo computes for `held` before it replies
  std::chrono::nanoseconds held{0};  ///< the engine's median time for this query during warm-up
  std::string floor_description;
  bool ended_early = false;  ///< Samples::kMost was reached
};

/// A performance target and its measured value.
struct Bar {
  std::string name;  ///< the compared quantity, with its unit
  double value = 0, limit = 0;
  bool met() const { return value <= limit; }
};
/// The targets of this report's transport. Median: excess over the bare baseline's median and the engine's own. Tail:
/// excess over a baseline whose echo computes as long as the engine, because longer queries meet more interrupts.
std::vector<Bar> bars_of(const BenchReport& report);

/// Returns "shm", "zmq-ipc", "zmq-tcp" or "lcm".
std::string transport_name(const std::string& url);

/// Prints aligned text, or one row of CSV or JSON.
void print_report(const BenchReport& report, std::ostream& out, Output output);

/// The report as one row.
Table row_of(const BenchReport& report);

/// Throws std::runtime_error unless rows with these columns can be added to this CSV file. Called before the
/// measurement.
void check_csv(const Table& row, const std::string& path);
/// Adds the table's rows, with column names if the file is new. Throws std::runtime_error.
void append_csv(const Table& row, const std::string& path);

/// The current time, as in 2026-01-31T12:00:00Z.
std::string utc_now();
/// Rounds to six significant digits, also for CSV: more would be noise.
Cell rounded(double value);

}  // namespace clearance::cli
