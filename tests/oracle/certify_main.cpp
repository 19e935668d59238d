// clearance-certify: checks every answer for many cases of each class with the oracle, and writes the accuracy table.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <mutex>
#include <thread>
#include <utility>

#include "tests/oracle/certify.h"
#include "tests/oracle/in_parallel.h"
#include "tests/oracle/oracle_run.h"
#include "tests/oracle/slack_oracle.h"

namespace clearance::exact {
namespace {

constexpr int kBatch = 200;

/// Cases from `first` to `first + count` of a class.
struct Batch {
  const CaseClass* c;
  std::size_t row;
  std::uint64_t first;
  int count;
};

/// Divides the pairs among the classes, with fewer for slower ones.
std::vector<Batch> share_out(const CertifyOptions& o) {
  double shares = 0;
  const auto chosen = [&](const CaseClass& c) { return o.only.empty() || c.name.find(o.only) != std::string::npos; };
  for (const CaseClass& c : o.classes()) shares += chosen(c) / static_cast<double>(c.cost);
  std::vector<Batch> batches;
  for (std::size_t k = 0; k < o.classes().size(); ++k) {
    const CaseClass& c = o.classes()[k];
    if (!chosen(c)) continue;
    const auto total = std::max<std::int64_t>(
        kBatch, static_cast<std::int64_t>(std::ceil(static_cast<double>(o.pairs) / shares / c.cost)));
    for (std::int64_t first = 0; first < total; first += kBatch)
      batches.push_back(
          {&c, k, static_cast<std::uint64_t>(first), static_cast<int>(std::min<std::int64_t>(kBatch, total - first))});
  }
  return batches;
}

void write_csv(std::ostream& out, const CertifyOptions& o, const std::vector<Setting>& settings,
               const std::vector<std::vector<Tally>>& table) {
  out << "# pairs " << o.pairs << ", seed " << o.seed << ", witness points and normals proved for one batch in "
      << o.columns_every << "\n"
      << "class,backend,precision,depth,columns,rel_tol,max_distance,cases,apart,touching,overlapping,violations,"
         "inaccurate,"
         "worst_error,worst_width,contact,unconverged,rounding_limited\n";
  for (std::size_t k = 0; k < table.size(); ++k)
    for (std::size_t s = 0; s < settings.size(); ++s) {
      const Tally& t = table[k][s];
      if (t.cases == 0) continue;
      char numbers[160];
      std::snprintf(numbers, sizeof numbers, "%.3g,%.3g", t.worst_error, t.worst_width);
      out << o.classes()[k].name << ',' << csv_key(settings[s]);
      out << ',' << t.cases << ',' << t.apart << ',' << t.touching << ',' << t.overlapping << ',' << t.violations << ','
          << t.inaccurate << ',' << numbers << ',' << t.contact << ',' << t.unconverged << ',' << t.rounding_limited
          << '\n';
    }
}

/// Attempts of each kind of slack_oracle.h. Returns whether all are right.
bool certify_slack(const CertifyOptions& o) {
  Findings findings;
  Random random(o.seed);
  for (std::int64_t i = 0; i < o.slack; ++i) {
    try_uncertain(random, findings);
    try_shapes(random, i % 2 == 1, findings);
    for (const CylinderAs as : {CylinderAs::kItself, CylinderAs::kPrism}) {
      try_cylinder(random, as, findings);
      try_crossed_cylinders(random, as, findings);
    }
    if (i % 100 == 0) try_age(random, findings);
  }
  if (o.slack > 0)
    std::cerr << "slack: " << findings.requested << " answers: " << findings.misses << " intervals that miss, "
              << findings.untrue << " untrue statuses, " << findings.wide << " too wide, " << findings.unresolved
              << " unsettled\n";
  return findings.all() == 0;
}

int certify(const CertifyOptions& o) {
  const std::vector<Setting> settings = standard_settings(o.backends, !o.meshes);
  const std::vector<Batch> batches = share_out(o);
  std::vector<std::vector<Tally>> table(o.classes().size(), std::vector<Tally>(settings.size()));
  std::ofstream failures;
  if (!o.failures.empty()) failures.open(o.failures);
  std::mutex mutex;
  std::size_t done = 0;
  std::int64_t bad = 0;
  in_parallel(batches.size(), o.threads, [&](std::size_t k) {
    const Batch& b = batches[k];
    std::vector<Case> cases;
    for (int i = 0; i < b.count; ++i) cases.push_back(make_case(*b.c, o.seed, b.first + static_cast<std::uint64_t>(i)));
    const bool columns = (b.first / kBatch) % static_cast<std::uint64_t>(o.columns_every) == 0;
    const auto report = [&](std::size_t i, const Setting& s, const CheckResult& v, const std::string& answer) {
      const std::lock_guard lock(mutex);
      if (++bad <= 20)
        std::cerr << b.c->name << ' ' << b.first + i << ", " << s.name() << ": " << v.violation << ' ' << v.inaccuracy
                  << '\n';
      if (failures)
        failures << "// " << b.c->name << ' ' << b.first + i << ", " << s.name() << ": " << v.violation << ' '
                 << v.inaccuracy << "\n// " << answer << '\n'
                 << as_initialiser(cases[i]);
    };
    const std::vector<Tally> tallies = try_cases(cases, settings, 1, columns, report);
    const std::lock_guard lock(mutex);
    for (std::size_t s = 0; s < settings.size(); ++s) table[b.row][s].add(tallies[s]);
    if (++done % 50 == 0 || done == batches.size()) std::cerr << done << " of " << batches.size() << " batches\n";
  });

  Tally all;
  for (const std::vector<Tally>& row : table)
    for (const Tally& t : row) all.add(t);
  if (o.csv.empty()) {
    write_csv(std::cout, o, settings, table);
  } else {
    std::ofstream out(o.csv);
    write_csv(out, o, settings, table);
    if (!out.flush()) throw std::runtime_error("cannot write " + o.csv);
  }
  std::cerr << all.cases << " answers: " << all.violations << " violations, " << all.inaccurate
            << " less accurate than promised, " << all.unconverged << " unconverged; worst error " << all.worst_error
            << ", worst width " << all.worst_width << " of what is allowed\n";
  return certify_slack(o) && all.violations == 0 ? 0 : 1;
}

}  // namespace
}  // namespace clearance::exact

int main(int argc, char** argv) {
  clearance::exact::CertifyOptions o;
  CLI::App app{"Puts seeded pairs of every class before the engine, judges every answer exactly, writes a table."};
  app.add_option("--pairs", o.pairs, "pairs in all; each is asked under every setting")->check(CLI::PositiveNumber);
  app.add_option("--slack", o.slack, "also scenes of each kind of slack, judged by all that is allowed")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--motions", o.motions, "in place of pairs so many motions, of all kinds, judged with 60 digits")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--trajectories", o.trajectories, "likewise, so many splines of two to four segments that overshoot")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--stops", o.stops,
                 "likewise, so many approaches of persons that an arm brakes for at the last moment")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--states", o.states,
                 "in place of pairs so many states of each robot, decided with and without covers")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--edges", o.edges, "likewise, so many edges: motions that are decided")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--distances", o.distances, "likewise, so many states whose distances are requested to tolerances")
      ->check(CLI::NonNegativeNumber)
      ->excludes("--states", "--edges");
  app.add_option("--robots", o.robots, "URDF files of robots whose states and edges are decided, too")
      ->check(CLI::ExistingFile);
  app.add_option("--seed", o.seed, "of the cases");
  app.add_option("--backend", o.backends, "backends to ask; cpu and reference if none is named. Motions: the first");
  app.add_option("--threads", o.threads, "batches at a time")->check(CLI::Range(1, 256));
  app.add_option("--columns-every", o.columns_every, "prove witness points and normals of one batch in this many")
      ->check(CLI::Range(1, 1000000));
  app.add_option("--csv", o.csv, "file to write; standard output if none");
  app.add_flag("--meshes", o.meshes,
               "the classes of bodies that are not convex, in place of those of hulls; robots with their true meshes");
  app.add_option("--class", o.only, "only classes whose names hold this");
  app.add_option("--failures", o.failures, "file to which cases that fail are written, in the form of mined_cases.inc");
  CLI11_PARSE(app, argc, argv);
  try {
    if (o.distances > 0) return clearance::exact::certify_distances(o) ? 0 : 1;
    if (o.states > 0 || o.edges > 0) return clearance::exact::certify_decisions(o) ? 0 : 1;
    if (o.stops > 0) return clearance::exact::certify_stops(o) ? 0 : 1;
    if (o.trajectories > 0) return clearance::exact::certify_trajectories(o) ? 0 : 1;
    if (o.motions > 0) return clearance::exact::certify_motions(o) ? 0 : 1;
    return clearance::exact::certify(o);
  } catch (const std::exception& e) {
    std::cerr << "clearance-certify: " << e.what() << '\n';
    return 2;
  }
}
