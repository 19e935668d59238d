// An engine with huge rounding terms of the wrong sign, so that bounds contradict each other in float64 and in
// double-double: it returns no wrong answer, and the self-test keeps it from starting.
#include <gtest/gtest.h>

#include <cstdio>
#include <limits>

#include "engine/engine.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

std::vector<Case> some_of_every_class() {
  std::vector<Case> cases;
  for (const CaseClass& cls : case_classes())
    for (std::uint64_t i = 0; i < (cls.cost > 3 ? 1 : 4); ++i) cases.push_back(make_case(cls, 61, i));
  return cases;
}

TEST(ContradictionMutant, ProvesNothingAndReportsIt) {
  const std::vector<Case> cases = some_of_every_class();
  int answers = 0, nothing = 0;
  for (const std::string backend : {"cpu", "reference"}) {
    const Bench bench(cases, backend);
    for (const Setting& s : standard_settings({backend}))
      for (const Answer& a : bench.evaluate(s)) {
        ++answers;
        EXPECT_TRUE(a.lower <= a.upper) << s.name() << ": " << in_words(a);
        if (a.lower != -kInf || a.upper != kInf) continue;
        ++nothing;
        EXPECT_EQ(a.status, Status::kUnconverged) << s.name() << ": " << in_words(a);
        if (!s.float32) {
          EXPECT_EQ(a.distance, kInf);
        }
      }
    EXPECT_GT(bench.engine().contradictions(), cases.size() / 4) << backend;
  }
  std::printf("nothing is proved by %d of %d answers\n", nothing, answers);
  EXPECT_GT(nothing, answers / 4);
}

TEST(ContradictionMutant, IsGivenToGroups) {
  const std::vector<Case> cases = some_of_every_class();
  const Bench bench(cases, "reference");
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 0; i < cases.size(); ++i) pairs.push_back({2 * i, 2 * i + 1});
  QueryView query;
  query.reduce = Reduce::kMin;
  query.pairs = pairs;
  query.all_pairs = false;
  double lower = 0, upper = 0;
  ReplyView reply;
  reply.lower = &lower;
  reply.upper = &upper;
  Job job = bench.engine().start(query, reply);
  while (!job.advance()) {
  }
  EXPECT_EQ(lower, -kInf);
  EXPECT_TRUE(lower <= upper);
}

TEST(ContradictionMutant, DoesNotStart) {
  try {
    engine::Engine engine{engine::Scene()};
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_EQ(std::string(e.what()).find(
                  "the engine does not start: its reference arithmetic fails the self-test on this machine"),
              0u)
        << e.what();
  }
}

}  // namespace
}  // namespace clearance::exact
