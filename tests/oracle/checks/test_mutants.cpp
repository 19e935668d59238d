// Mutation tests: this file is linked once with the engine, and once with each version of it that lacks one proof
// (CMakeLists.txt). The oracle must find no error in the first, and the oracle or the engine's own check of its
// intervals must detect every other, on the same cases.
#include <gtest/gtest.h>

#include <cstdio>

#include "engine/engine.h"
#include "tests/oracle/damage.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 11;

struct Tried {
  int answers = 0, violations = 0;
  std::uint64_t contradictions = 0;
};
/// Some cases of a class with and without depth on both backends, with tolerance 0 so that rounding decides.
void try_class(const CaseClass& cls, Tried& tried) {
  std::vector<Case> cases;
  std::vector<Result> exact_value;
  for (int i = 0; i < (cls.cost > 3 ? 10 : 40); ++i) {
    cases.push_back(make_case(cls, kSeed, static_cast<std::uint64_t>(i)));
    exact_value.push_back(exact_answer(cases.back()));
  }
  for (const char* backend : {"cpu", "reference"}) {
    const Bench bench(cases, backend);
    for (const bool depth : {false, true}) {
      Setting s;
      s.backend = backend;
      s.signed_distance = depth;
      s.rel_tol = 0;
      const std::vector<Answer> answers = bench.evaluate(s);
      for (std::size_t i = 0; i < cases.size(); ++i) {
        ++tried.answers;
        tried.violations += !hold_against(cases[i], exact_value[i], s, answers[i], false).violation.empty();
      }
    }
    tried.contradictions += bench.engine().contradictions();
  }
}

TEST(Mutants, AreFound) {
  Tried tried;
  const auto found = [&] { return static_cast<std::uint64_t>(tried.violations) + tried.contradictions; };
#ifdef CLEARANCE_MUTANT
  // Contradictory bounds are never returned: the engine detects such a mutant itself, and answers correctly. The first
  // class that detects it is enough.
  for (const CaseClass& cls : case_classes()) {
    try_class(cls, tried);
    if (found()) break;
  }
  EXPECT_GT(found(), 0u);
#else
  for (const CaseClass& cls : case_classes()) try_class(cls, tried);
  EXPECT_EQ(found(), 0u);
#endif
  std::printf("%d violations and %llu contradictions in %d answers\n", tried.violations,
              static_cast<unsigned long long>(tried.contradictions), tried.answers);
}

// The mined cases must detect the mutants that they were kept for: rounding, and radii added in double. They need not
// detect the others.
#if !defined(CLEARANCE_MUTANT) || defined(CLEARANCE_MUTANT_OF_ROUNDING)
TEST(Mutants, OfRoundingAreFoundByMinedCases) {
  std::vector<Case> cases;
  for (const MinedCase& m : mined_cases()) cases.push_back(m.pair);
  ASSERT_FALSE(cases.empty());
  std::vector<bool> found(cases.size());
  try_cases(cases, standard_settings(), 1, false,
            [&](std::size_t i, const Setting&, const CheckResult& v, const std::string&) {
              if (!v.violation.empty()) found[i] = true;
            });
  const auto count = std::count(found.begin(), found.end(), true);
  std::printf("%d of %zu mined cases find a violation\n", static_cast<int>(count), cases.size());
#ifdef CLEARANCE_MUTANT
  EXPECT_GT(count, 0);
#else
  EXPECT_EQ(count, 0);
#endif
}
#endif

}  // namespace
}  // namespace clearance::exact
