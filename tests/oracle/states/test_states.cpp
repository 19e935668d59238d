// Decisions about states and motions with covers, compared with those without and with exact arithmetic.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/oracle/states/exact_state.h"
#include "tests/oracle/states/state_oracle.h"

namespace clearance::exact {
namespace {

/// Prints a table by kind, expects enough of each, and returns the sum.
StateTally sum_of(const char* what, const StateTable& table, int least_hits, int least_exact) {
  StateTally all;
  for (std::size_t kind = 0; kind < table.size(); ++kind) {
    StateTally of_kind;
    for (const StateTally& tally : table[kind]) of_kind.add(tally);
    std::printf("%-7s %-9s %s\n", what, name_of(static_cast<StateKind>(kind)).c_str(), of_kind.text().c_str());
    EXPECT_GT(of_kind.hit, least_hits);
    EXPECT_GT(of_kind.exact, least_exact);
    all.add(of_kind);
  }
  EXPECT_EQ(all.errors(), 0) << all.text();
  return all;
}

// In one process: the covers take seconds.
TEST(States, CoversDecideAsTheExactEngine) {
  const RobotScene robot = made_robot(2);
  StateOracle oracle(robot, covers_of(robot));

  const StateTally states = sum_of("states", compare_states(oracle, 12'000, 1), 400, 20);
  EXPECT_GT(states.free, 2000);
  EXPECT_GT(states.close_free, 50);
  EXPECT_GT(states.close_hit, 80);
  EXPECT_GT(states.inside, 200);
  EXPECT_GT(states.exact, 150);
  EXPECT_LT(states.open, states.pairs / 3) << "covers decide little";

  const StateTally motions = sum_of("motions", compare_motions(oracle, 1500, 2), 50, 10);
  EXPECT_GT(motions.free, 200);
  EXPECT_GT(motions.close_free, 10);
  EXPECT_GT(motions.close_hit, 20);
  EXPECT_GT(motions.inside, 50);
  EXPECT_LT(motions.open, motions.pairs / 4 * 3) << "covers decide little";

  DistanceTally distances;
  const DistanceTable table = compare_distances(oracle, 6000, 3);
  for (std::size_t kind = 0; kind < table.size(); ++kind) {
    DistanceTally of_kind;
    for (const DistanceTally& tally : table[kind]) of_kind.add(tally);
    std::printf("distances %-9s %s\n", name_of(static_cast<StateKind>(kind)).c_str(), of_kind.text().c_str());
    EXPECT_GT(of_kind.apart, 1000);
    EXPECT_GT(of_kind.exact, 20);
    distances.add(of_kind);
  }
  EXPECT_EQ(distances.errors(), 0) << distances.text();
  EXPECT_GT(distances.overlap, 1000);
  EXPECT_GT(distances.surfaces, 20);
  EXPECT_GT(distances.carried, 5);
  EXPECT_LT(distances.evaluated, distances.pairs / 4 * 3) << "covers answer little";
}

// The test above would find an engine that is wrong by half a millimetre.
TEST(States, TheOracleFindsHalfAMillimetre) {
  const PlacedBody a{{{{{0, 0, 0}}, {{0, 0, 0}}, 0.1, 0}}}, b{{{{{0, 0, 0.3}}, {{0, 0, 0.3}}, 0.1, 0}}};
  EXPECT_TRUE(is_nearer(a, b, 0.1005));
  EXPECT_FALSE(is_nearer(a, b, 0.0995));
  EXPECT_TRUE(is_farther(a, b, 0.0995));
  EXPECT_FALSE(is_farther(a, b, 0.1005));
  EXPECT_FALSE(is_farther(a, {}, 0.0995));
}

}  // namespace
}  // namespace clearance::exact
