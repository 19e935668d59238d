// Every setting of a query that trades accuracy for time, measured on one scene.
#pragma once

#include <iosfwd>
#include <limits>
#include <string>
#include <vector>

#include "bench/tradeoff/truth.h"

namespace clearance::tradeoff {

/// How the steps of the motion are queried.
enum class Requested : std::uint8_t {
  kSteps,  ///< one query per step
  kBatch,  ///< one query for all steps, as its configurations
};

struct Setting {
  Precision precision = Precision::kF64;
  double rel_tol = 1e-6;
  double abs_tol = 0;                                      ///< in metres
  double reach = std::numeric_limits<double>::infinity();  ///< max_distance, in medians of the scene's distances
  Requested requested = Requested::kSteps;

  friend bool operator==(const Setting&, const Setting&) = default;
};

/// The default query.
inline constexpr Setting kDefault{};

/// All combinations of precision, tolerance, max_distance and query mode.
/// \param brief only a few of them, for tests
std::vector<Setting> all_settings(bool brief);

/// Statistics of finite values; 0 if there are none.
struct Spread {
  double p50 = 0, p99 = 0, max = 0;
};
Spread spread_of(std::vector<double> values);

/// One setting on one scene.
struct Point {
  Setting setting;
  double ns_per_pair = 0;       ///< median over the rounds
  double ns_quartiles = 0;      ///< third quartile minus first
  double ratio = 0;             ///< median of the time relative to the default query in the same round
  double evaluated = 0;         ///< share of pairs that boxes alone did not answer
  Spread error, width;          ///< in metres, of answers that are not beyond
  Spread rel_error, rel_width;  ///< the same relative to the exact distance, of separate pairs
  double ok = 0, overlap = 0, contact = 0, beyond = 0, unconverged = 0;  ///< shares of answers
  std::size_t violations = 0;                                            ///< intervals that miss the exact distance
};

struct SweepOptions {
  std::string backend = "cpu";
  int rounds = 9;  ///< number of timings of each setting
  bool brief = false;
};

/// Times all settings alternately, round by round, with one thread, and compares every answer with the exact distance.
std::vector<Point> sweep(const MovingScene& scene, const ExactDistances& exact_value, const SweepOptions& options);

/// The column names, and one row for each point.
void write_header(std::ostream& out);
void write_rows(std::ostream& out, const MovingScene& scene, const ExactDistances& exact_value,
                const SweepOptions& options, const std::vector<Point>& points);

}  // namespace clearance::tradeoff
