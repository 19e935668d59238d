// The parts of clearance-certify about states and edges of robots: decisions, and distances to tolerances.
#include <fstream>
#include <iostream>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "tests/oracle/certify.h"
#include "tests/oracle/in_parallel.h"
#include "tests/oracle/states/state_oracle.h"

namespace clearance::exact {
namespace {

constexpr std::size_t kMade = 2, kShares = 16;

/// A robot whose states and edges are compared.
struct ComparedRobot {
  RobotScene made;
  RobotCovers covers;
  StateTable states, edges;
  DistanceTable distances;
};

std::vector<ComparedRobot> compared_robots(const CertifyOptions& o) {
  std::vector<ComparedRobot> robots(kMade + o.robots.size());
  in_parallel(robots.size(), o.threads, [&](std::size_t r) {
    robots[r].made =
        r < kMade ? made_robot(r + 1) : robot_of(o.robots[r - kMade], o.meshes ? MeshAs::kAuto : MeshAs::kHull);
    robots[r].covers = covers_of(robots[r].made);
    std::cerr << robots[r].made.name << " has covers\n";
  });
  return robots;
}

/// Shares of each robot. `compare` takes a robot, its oracle and a seed, and returns a function that adds the results to the robot's and
/// returns their text.
template <class Compare>
void compare_shares(const CertifyOptions& o, std::vector<ComparedRobot>& robots, const Compare& compare) {
  std::mutex mutex;
  in_parallel(robots.size() * kShares, o.threads, [&](std::size_t k) {
    ComparedRobot& robot = robots[k % robots.size()];
    const std::uint64_t share = k / robots.size();
    StateOracle oracle(robot.made, robot.covers);
    const auto add = compare(robot, oracle, o.seed * 1'000 + share);
    const std::lock_guard lock(mutex);
    std::cerr << robot.made.name << ", share " << share << ": " << add() << '\n';
  });
}

template <class Table, class Tally>
void add(const Table& from, Table& to, Tally& all) {
  for (std::size_t kind = 0; kind < from.size(); ++kind)
    for (std::size_t c = 0; c < from[kind].size(); ++c) {
      to[kind][c].add(from[kind][c]);
      all.add(from[kind][c]);
    }
}

/// Writes rows of a table.
/// \param columns values of the table's columns
/// \param numbers returns those of a tally
template <class Table, class Columns, class Numbers>
void write_table(std::ostream& out, const std::string& start, const Table& table, const Columns& columns,
                 const Numbers& numbers) {
  for (std::size_t kind = 0; kind < table.size(); ++kind)
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (table[kind][c].count == 0) continue;
      out << start << ',' << name_of(static_cast<StateKind>(kind)) << ',' << columns[c];
      for (const std::int64_t n : numbers(table[kind][c])) out << ',' << n;
      out << '\n';
    }
}

void write_decisions(std::ostream& out, const CertifyOptions& o, const std::vector<ComparedRobot>& robots) {
  out << "# states " << o.states << " and edges " << o.edges << " of each robot, seed " << o.seed << "\n"
      << "of,robot,kind,margin,count,free,hit,wrong,fewer,more,other_pairs,other_bits,exact,untrue,close_free,"
         "close_hit,inside,pairs_without,pairs_with\n";
  const auto numbers = [](const StateTally& t) {
    return std::array{t.count, t.free,   t.hit,        t.wrong,     t.fewer,  t.more,  t.other_pairs, t.other_bits,
                      t.exact, t.untrue, t.close_free, t.close_hit, t.inside, t.pairs, t.open};
  };
  for (const ComparedRobot& robot : robots) {
    write_table(out, "state," + robot.made.name, robot.states, kStateMargins, numbers);
    write_table(out, "edge," + robot.made.name, robot.edges, kStateMargins, numbers);
  }
}

void write_distances(std::ostream& out, const CertifyOptions& o, const std::vector<ComparedRobot>& robots) {
  out << "# states " << o.distances << " of each robot, seed " << o.seed << "\n"
      << "robot,kind,abs_tol,states,rows,apart,overlap,contact,wrong,wider,exact,untrue,surfaces,pairs_exact,"
         "pairs_with\n";
  for (const ComparedRobot& robot : robots)
    write_table(out, robot.made.name, robot.distances, kDistanceTolerances, [](const DistanceTally& t) {
      return std::array{t.count, t.rows,  t.apart,  t.overlap,  t.contact, t.wrong,
                        t.wider, t.exact, t.untrue, t.surfaces, t.pairs,   t.evaluated};
    });
}

template <class Write>
void write_csv(const CertifyOptions& o, const std::vector<ComparedRobot>& robots, const Write& write) {
  if (o.csv.empty()) return;
  std::ofstream out(o.csv);
  write(out, o, robots);
  if (!out.flush()) throw std::runtime_error("cannot write " + o.csv);
}

}  // namespace

bool certify_decisions(const CertifyOptions& o) {
  std::vector<ComparedRobot> robots = compared_robots(o);
  StateTally all;
  compare_shares(o, robots, [&](ComparedRobot& robot, StateOracle& oracle, std::uint64_t seed) {
    StateTable states{}, edges{};
    if (o.states > 0) states = compare_states(oracle, o.states / static_cast<std::int64_t>(kShares), seed);
    if (o.edges > 0) edges = compare_motions(oracle, o.edges / static_cast<std::int64_t>(kShares), seed);
    return [&, states, edges] {
      add(states, robot.states, all);
      add(edges, robot.edges, all);
      return all.text();
    };
  });
  write_csv(o, robots, write_decisions);
  return all.errors() == 0;
}

bool certify_distances(const CertifyOptions& o) {
  std::vector<ComparedRobot> robots = compared_robots(o);
  DistanceTally all;
  compare_shares(o, robots, [&](ComparedRobot& robot, StateOracle& oracle, std::uint64_t seed) {
    const DistanceTable distances = compare_distances(oracle, o.distances / static_cast<std::int64_t>(kShares), seed);
    return [&, distances] {
      add(distances, robot.distances, all);
      return all.text();
    };
  });
  write_csv(o, robots, write_distances);
  if (all.rows == 0) throw std::runtime_error("--distances: too few states for a row");
  return all.errors() == 0;
}

}  // namespace clearance::exact
