// Mutation tests: this file is linked once with the engine as it is, and once with each version of it that has one
// proof taken out (CMakeLists.txt). The judge must find nothing wrong with the first, and the judge or the engine's own
// look at its intervals must find every other, on the same cases.
#include <gtest/gtest.h>

#include <cstdio>

#include "damage.h"
#include "engine/engine.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 11;

struct Judged {
  std::vector<Case> cases;
  std::vector<Result> truth;
};
/// Some of every class.
const std::vector<Judged>& judged() {
  static const std::vector<Judged> kJudged = [] {
    std::vector<Judged> all;
    for (const CaseClass& cls : case_classes()) {
      Judged& j = all.emplace_back();
      for (int i = 0; i < (cls.cost > 3 ? 10 : 40); ++i) {
        j.cases.push_back(make_case(cls, kSeed, static_cast<std::uint64_t>(i)));
        j.truth.push_back(judge(j.cases.back()));
      }
    }
    return all;
  }();
  return kJudged;
}

struct Tried {
  int answers = 0, violations = 0;
  std::uint64_t contradictions = 0;
};
/// All of them with and without depth on both backends, with tolerance 0 so that rounding decides.
Tried try_all() {
  Tried tried;
  for (const Judged& j : judged())
    for (const char* backend : {"cpu", "reference"}) {
      const Bench bench(j.cases, backend);
      for (const bool depth : {false, true}) {
        Setting s;
        s.backend = backend;
        s.signed_distance = depth;
        s.rel_tol = 0;
        const std::vector<Answer> answers = bench.ask(s);
        for (std::size_t i = 0; i < j.cases.size(); ++i) {
          ++tried.answers;
          tried.violations += !hold_against(j.cases[i], j.truth[i], s, answers[i], false).violation.empty();
        }
      }
      tried.contradictions += bench.engine().contradictions();
    }
  return tried;
}

TEST(Mutants, AreFound) {
  const Tried tried = try_all();
  std::printf("%d violations and %llu contradictions in %d answers\n", tried.violations,
              static_cast<unsigned long long>(tried.contradictions), tried.answers);
#ifdef CLEARANCE_MUTANT
  // Bounds that contradict each other do not leave the engine: it finds such a mutant itself, and answers rightly.
  EXPECT_GT(static_cast<std::uint64_t>(tried.violations) + tried.contradictions, 0u);
#else
  EXPECT_EQ(tried.violations, 0);
  EXPECT_EQ(tried.contradictions, 0u);
#endif
}

// The cases that a search kept must find the proofs that they were kept for: rounding, and radii added in double. The
// other mutants are none of theirs.
#if !defined(CLEARANCE_MUTANT) || defined(CLEARANCE_MUTANT_OF_ROUNDING)
TEST(Mutants, OfRoundingAreFoundByMinedCases) {
  std::vector<Case> cases;
  for (const MinedCase& m : mined_cases()) cases.push_back(m.pair);
  ASSERT_FALSE(cases.empty());
  std::vector<bool> found(cases.size());
  try_cases(cases, standard_settings(), 1, false,
            [&](std::size_t i, const Setting&, const Verdict& v, const std::string&) {
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
