// Every setting of a query that trades accuracy for time, measured on one scene.
#pragma once

#include <iosfwd>
#include <limits>
#include <string>
#include <vector>

#include "bench/tradeoff/truth.h"

namespace clearance::tradeoff {

/// How the steps of the motion are asked about.
enum class Asked : std::uint8_t {
  kCold,   ///< one query for each step
  kWarm,   ///< the same, with warm state
  kBatch,  ///< one query for all steps, as its configurations
};

struct Setting {
  Precision precision = Precision::kF64;
  double rel_tol = 1e-6;
  double abs_tol = 0;                                      ///< metres
  double reach = std::numeric_limits<double>::infinity();  ///< max_distance, in medians of the scene's distances
  Asked asked = Asked::kCold;

  friend bool operator==(const Setting&, const Setting&) = default;
};

/// The default query.
inline constexpr Setting kDefault{};

/// precision x tolerance x max_distance x way of asking. \param brief a few of them, for tests.
std::vector<Setting> all_settings(bool brief);

/// Of a number of values, all finite; 0 without any.
struct Spread {
  double p50 = 0, p99 = 0, max = 0;
};
Spread spread_of(std::vector<double> values);

/// One setting on one scene.
struct Point {
  Setting setting;
  double ns_per_pair = 0;       ///< median over the rounds
  double ns_quartiles = 0;      ///< third quartile minus first
  double ratio = 0;             ///< to the default query, timed in the same round: the median
  double evaluated = 0;         ///< share of pairs that boxes alone did not answer
  Spread error, width;          ///< metres, of answers that are not beyond
  Spread rel_error, rel_width;  ///< the same over the exact distance, of pairs that are apart
  double ok = 0, overlap = 0, contact = 0, beyond = 0, unconverged = 0;  ///< shares of answers
  std::size_t violations = 0;                                            ///< intervals that miss the exact distance
};

struct SweepOptions {
  std::string backend = "cpu";
  int rounds = 9;  ///< how often each setting is timed
  bool brief = false;
};

/// Times all settings in turns, round after round, with one thread, and holds every answer against the truth.
std::vector<Point> sweep(const MovingScene& scene, const ExactDistances& truth, const SweepOptions& options);

/// The column names, and one row for each point.
void write_header(std::ostream& out);
void write_rows(std::ostream& out, const MovingScene& scene, const ExactDistances& truth, const SweepOptions& options,
                const std::vector<Point>& points);

}  // namespace clearance::tradeoff
