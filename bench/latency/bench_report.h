// What a latency benchmark found, for people and as a row of CSV.
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
  std::uint64_t configurations = 0;  ///< 0: the current poses
  std::size_t moved_bodies = 0;
  std::string reduce, precision;
  double rate_hz = 0;  ///< 0: closed loop
  double warmup_s = 0;
  EchoSize size;
  Series ours, floor;
  Series held_floor;                 ///< the floor whose echo computes for `held` before it replies
  std::chrono::nanoseconds held{0};  ///< the engine's own time for this query: its median as the bench warmed up
  std::string floor_description;
  bool ended_early = false;  ///< Samples::kMost was reached
};

/// A bar that we hold ourselves to, and what was measured.
struct Bar {
  std::string name;  ///< of what is compared, with its unit
  double value = 0, limit = 0;
  bool met() const { return value <= limit; }
};
/// The bars of this report's transport. The median: what a query takes beyond the bare floor's median and the engine's
/// own. The tail: over that of a floor whose echo computes as long as the engine, since a query that takes longer meets
/// more interrupts.
std::vector<Bar> bars_of(const BenchReport& report);

/// "shm", "zmq-ipc", "zmq-tcp", "lcm".
std::string transport_name(const std::string& url);

/// Aligned for people, or one row of CSV or JSON.
void print_report(const BenchReport& report, std::ostream& out, Output output);

/// The report as one row.
Table row_of(const BenchReport& report);

/// Throws std::runtime_error unless rows of these columns can be added to this CSV file: said before anything is
/// measured.
void check_csv(const Table& row, const std::string& path);
/// Adds the table's rows, with the column names if the file is new. Throws std::runtime_error.
void append_csv(const Table& row, const std::string& path);

/// This moment, as in 2026-01-31T12:00:00Z.
std::string utc_now();
/// Six significant digits, also in CSV: more would be noise.
Cell rounded(double value);

}  // namespace clearance::cli
