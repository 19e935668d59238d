// Decisions about states with covers, compared with those without and with exact arithmetic.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/oracle/states/exact_state.h"
#include "tests/oracle/states/state_oracle.h"

namespace clearance::exact {
namespace {

TEST(States, CoversDecideAsTheExactEngine) {
  StateOracle oracle(made_robot(1));
  const StateTable table = compare_states(oracle, 30'000, 1);
  StateTally all;
  for (std::size_t kind = 0; kind < table.size(); ++kind) {
    StateTally of_kind;
    for (const StateTally& tally : table[kind]) of_kind.add(tally);
    std::printf("%-9s %s\n", name_of(static_cast<StateKind>(kind)).c_str(), of_kind.text().c_str());
    EXPECT_GT(of_kind.states, 1000);
    EXPECT_GT(of_kind.hit, 500);
    EXPECT_GT(of_kind.exact, 30);
    all.add(of_kind);
  }
  EXPECT_EQ(all.errors(), 0) << all.text();
  EXPECT_GT(all.free, 5000);
  EXPECT_GT(all.close_free, 200);
  EXPECT_GT(all.close_hit, 200);
  EXPECT_GT(all.inside, 500);
  EXPECT_GT(all.exact, 300);
  EXPECT_LT(all.open, all.pairs / 3) << "covers decide little";
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
