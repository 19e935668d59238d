#include "bench/prepared/timed_files.h"

#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/api/engine.h"

namespace clearance {
namespace {

constexpr std::size_t kFewNumbers = 10'000;  // in a round
constexpr const char* kCovers[] = {"off", "background"};

std::vector<double> read_rows(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + path);
  const std::string bytes(std::istreambuf_iterator<char>(in), {});
  std::vector<double> rows(bytes.size() / sizeof(double));
  std::memcpy(rows.data(), bytes.data(), rows.size() * sizeof(double));
  return rows;
}

double processor_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// A query and its inputs, a number of rows at a time.
struct TimedQuery {
  std::string name;
  Prepared query;
  std::span<const double> rows;
  std::size_t at_once;  ///< numbers in a call
  std::vector<double> seconds = {};

  void run() {
    for (std::size_t at = 0; at + at_once <= rows.size(); at += at_once) query.run(rows.subspan(at, at_once));
  }
  /// Few rows are run repeatedly, after they have filled the caches.
  void time_round() {
    const std::size_t repeats = kFewNumbers / std::max<std::size_t>(rows.size(), 1) + 1;
    run();
    const double begin = processor_seconds();
    for (std::size_t i = 0; i < repeats; ++i) run();
    seconds.push_back((processor_seconds() - begin) / static_cast<double>(repeats));
  }
  void print() const {
    std::printf("%s", name.c_str());
    for (const double each : seconds) std::printf(" %.9f", each);
    std::printf("\n");
  }
};

void time_by_turns(std::vector<TimedQuery>& queries, int rounds) {
  for (int round = 0; round < rounds; ++round)
    for (TimedQuery& query : queries) query.time_round();
  for (const TimedQuery& query : queries) query.print();
}

/// Engines with one thread, without and with covers.
std::vector<std::unique_ptr<Engine>> engines_of(const std::string& scene) {
  std::vector<std::unique_ptr<Engine>> engines;
  for (const char* covers : kCovers) {
    engines.push_back(
        std::make_unique<Engine>(Scene::load(scene), EngineOptions{.backend = "cpu", .threads = 1, .covers = covers}));
    engines.back()->wait_covers();
  }
  return engines;
}

/// Verdicts of a file's states or edges, in a batch and one a call.
void add_verdicts(const Engine& engine, const char* covers, const std::string& robot, double margin,
                  const std::string& file, std::span<const double> rows, std::vector<TimedQuery>& queries) {
  const Joints joints = engine.joints(robot);
  Query query{.joints = joints.ids};
  query.margin = margin;
  query.reduce = Reduce::kAny;
  query.fields = kFieldVerdict;
  const bool of_edges = file.ends_with("edges");
  if (of_edges) query = as_motions(query);
  const std::size_t each = joints.size() * (of_edges ? 2 : 1), count = rows.size() / each;
  if (count == 0) throw std::runtime_error(file + " has no row of " + std::to_string(each) + " numbers");
  rows = rows.first(count * each);
  for (const auto& [way, at_once] : {std::pair{"batch", count * each}, std::pair{"call", each}})
    queries.push_back(
        {file + " " + covers + " " + way + " " + std::to_string(count), engine.prepare(query), rows, at_once});
}

}  // namespace

void time_states(const std::string& scene, const std::string& robot, const std::string& file, int rounds) {
  const std::vector<double> states = read_rows(file);
  constexpr std::uint32_t kBounds = kFieldLower | kFieldUpper | kFieldStatus | kFieldPair;
  const std::vector<std::unique_ptr<Engine>> engines = engines_of(scene);
  std::vector<TimedQuery> queries;
  for (std::size_t i = 0; i < engines.size(); ++i) {
    const Joints joints = engines[i]->joints(robot);
    for (const auto& [name, reduce, fields] :
         {std::tuple{"verdict", Reduce::kAny, std::uint32_t{kFieldVerdict}},
          std::tuple{"check", Reduce::kAny, kFieldVerdict | kFieldPair}, std::tuple{"bounds", Reduce::kAny, kBounds},
          std::tuple{"least", Reduce::kMin, kFieldLower | kFieldUpper}})
      queries.push_back({std::string(name) + " " + kCovers[i],
                         engines[i]->prepare({.joints = joints.ids, .reduce = reduce, .fields = fields}), states,
                         joints.size()});
  }
  time_by_turns(queries, rounds);
}

void time_verdicts(const std::string& scene, const std::string& robot, int rounds, double margin,
                   std::span<const std::string> files) {
  const std::vector<std::unique_ptr<Engine>> engines = engines_of(scene);
  std::vector<std::vector<double>> rows;
  for (const std::string& file : files) rows.push_back(read_rows(file));
  std::vector<TimedQuery> queries;
  for (std::size_t f = 0; f < files.size(); ++f)
    for (std::size_t i = 0; i < engines.size(); ++i)
      add_verdicts(*engines[i], kCovers[i], robot, margin, files[f], rows[f], queries);
  time_by_turns(queries, rounds);
}

}  // namespace clearance
