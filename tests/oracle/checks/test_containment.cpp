// Compares the engine with the oracle: every class of cases, every backend, every setting. For every answer the exact
// distance must lie within its bounds, its status must be true, its error within the limit, and its columns must prove
// it.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/oracle/oracle_run.h"
#include "tests/source_file.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 1;  // the first batch of clearance-certify, which wrote the recorded table
constexpr int kCases = 200;

/// Worst error and width of a class under a setting in docs/results/accuracy_sample.csv.
struct Recorded {
  double error = -1, width = -1;
};
Recorded recorded(const std::string& cls, const Setting& s) {
  static const std::map<std::string, Recorded> kTable = [] {
    std::map<std::string, Recorded> table;
    std::ifstream in(source_file("docs/results/accuracy_sample.csv"));
    for (std::string line; std::getline(in, line);) {
      std::vector<std::string> cells;
      std::stringstream row(line);
      for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
      if (line[0] == '#' || cells[0] == "class" || cells.size() < 17) continue;
      std::string key;
      for (int k = 0; k < 7; ++k) key += cells[static_cast<std::size_t>(k)] + ',';
      table[key] = {std::stod(cells[13]), std::stod(cells[14])};
    }
    return table;
  }();
  const auto found = kTable.find(cls + ',' + csv_key(s) + ',');
  return found == kTable.end() ? Recorded{} : found->second;
}

class Containment : public testing::TestWithParam<std::size_t> {};

TEST_P(Containment, HoldsForEveryAnswer) {
  const CaseClass& c = case_classes()[GetParam()];
  std::vector<Case> cases;
  for (int i = 0; i < kCases; ++i) cases.push_back(make_case(c, kSeed, static_cast<std::uint64_t>(i)));
  const std::vector<Setting> settings = standard_settings();
  int shown = 0;
  const std::vector<Tally> tallies = try_cases(
      cases, settings, 1, true, [&](std::size_t i, const Setting& s, const CheckResult& v, const std::string& answer) {
        if (++shown > 5) return;
        ADD_FAILURE() << c.name << " case " << i << " of seed " << kSeed << ", " << s.name() << ": " << v.violation
                      << " " << v.inaccuracy << "\n  " << answer << "\n  exact "
                      << exact_answer(cases[i]).distance.lower() << "\n  " << as_initialiser(cases[i]);
      });
  for (std::size_t k = 0; k < settings.size(); ++k) {
    const Tally& t = tallies[k];
    std::printf("%-44s worst error %.3g and width %.3g of what is allowed; %lld contact, %lld unconverged\n",
                settings[k].name().c_str(), t.worst_error, t.worst_width, static_cast<long long>(t.contact),
                static_cast<long long>(t.unconverged));
    EXPECT_EQ(t.cases, kCases);
    EXPECT_EQ(t.violations, 0) << settings[k].name();
    EXPECT_EQ(t.inaccurate, 0) << settings[k].name();
    EXPECT_LE(t.worst_width, 1.0) << settings[k].name();
    EXPECT_EQ(t.unconverged, 0) << settings[k].name();
    // The recorded table must be neither better than the actual values, nor much worse. Cases may differ in the last
    // bits between C libraries.
    const Recorded r = recorded(c.name, settings[k]);
    const char* advice =
        ": the recorded table is out of date; if this is meant, run clearance-certify --pairs 1 --csv "
        "docs/results/accuracy_sample.csv";
    EXPECT_LE(t.worst_error, 2 * r.error + 0.05) << settings[k].name() << advice;
    EXPECT_LE(t.worst_width, 2 * r.width + 0.05) << settings[k].name() << advice;
    EXPECT_LE(r.error, 4 * t.worst_error + 0.1) << settings[k].name() << advice;
    EXPECT_LE(r.width, 4 * t.worst_width + 0.1) << settings[k].name() << advice;
  }
}

// Pairs that the engine, or the oracle, once got wrong, with their exact answers.
TEST(MinedCases, KeepTheirExactAnswers) {
  ASSERT_GE(mined_cases().size(), 10u);
  for (std::size_t i = 0; i < mined_cases().size(); ++i) {
    const MinedCase& m = mined_cases()[i];
    EXPECT_EQ(exact_answer(m.pair).distance.lower(), m.exact) << "case " << i;
  }
}

TEST(MinedCases, AreAnsweredRight) {
  std::vector<Case> cases;
  for (const MinedCase& m : mined_cases()) cases.push_back(m.pair);
  const std::vector<Tally> tallies =
      try_cases(cases, standard_settings(), 1, true,
                [&](std::size_t i, const Setting& s, const CheckResult& v, const std::string& answer) {
                  ADD_FAILURE() << "mined case " << i << ", " << s.name() << ": " << v.violation << ' ' << v.inaccuracy
                                << "\n  " << answer;
                });
  for (const Tally& t : tallies) {
    EXPECT_LE(t.worst_width, 1.0);
    EXPECT_EQ(t.unconverged, 0);
  }
}

INSTANTIATE_TEST_SUITE_P(Classes, Containment, testing::Range<std::size_t>(0, case_classes().size()),
                         [](const auto& param) { return case_classes()[param.param].name; });

}  // namespace
}  // namespace clearance::exact
