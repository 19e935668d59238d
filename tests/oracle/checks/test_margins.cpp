// Compares decisions about margins with the exact oracle: `beyond` and "within" are proofs, for margins equal to the
// exact distance, one step of double from it, and others. Linked once with the engine, and once with each faulty one
// that decides wrongly (CMakeLists.txt), which the oracle must detect.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "engine/engine.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kSeed = 29;

struct Row {
  double lower, upper;
  Status status;
  BodyPair pair;
};
Row decide(const engine::Engine& engine, QueryView q) {
  q.all_pairs = false;
  q.reduce = Reduce::kAny;
  Row row;
  std::uint8_t status = 0;
  ReplyView reply;
  reply.rows = 1;
  reply.lower = &row.lower;
  reply.upper = &row.upper;
  reply.status = &status;
  reply.pair = &row.pair;
  Job job = engine.start(q, reply);
  while (!job.advance()) {
  }
  row.status = static_cast<Status>(status);
  return row;
}

struct Tried {
  int answers = 0, violations = 0, beyond = 0, within = 0, open = 0, avoidable = 0;
};
bool is_within(Status s) {
  return s == Status::kOk || s == Status::kContact || s == Status::kOverlap;
}
// Whether bodies 2i and 2i+1 are farther apart than a margin, in real arithmetic.
bool is_farther(const Result& exact_value, double margin) {
  return exact_value.distance.compare(margin) > 0;
}

void hold(const Row& row, std::span<const Result> exact_value, std::span<const BodyPair> pairs,
          std::span<const double> margins, Tried& tried) {
  ++tried.answers;
  bool all = true;
  for (std::size_t i = 0; i < pairs.size(); ++i) all = all && is_farther(exact_value[pairs[i].a / 2], margins[i]);
  if (row.status == Status::kBeyond) {
    ++tried.beyond;
    tried.violations += !all || !(row.lower > *std::min_element(margins.begin(), margins.end()));
  } else if (is_within(row.status)) {
    ++tried.within;
    const auto named = static_cast<std::size_t>(std::find(pairs.begin(), pairs.end(), row.pair) - pairs.begin());
    if (named == pairs.size() || is_farther(exact_value[row.pair.a / 2], margins[named]) ||
        !(row.upper <= margins[named]) || exact_value[row.pair.a / 2].distance.compare(row.upper) > 0 ||
        (row.lower > 0 && exact_value[row.pair.a / 2].distance.compare(row.lower) < 0))
      ++tried.violations;
  } else {
    ++tried.open;
    tried.violations += row.status != Status::kUnconverged;
  }
}

std::vector<double> margins_around(const Result& exact_value) {
  const double low = std::max(exact_value.distance.lower(), 0.0), high = std::max(exact_value.distance.upper(), 0.0);
  return {0,        std::nextafter(low, 0),     low,
          high,     std::nextafter(high, kInf), 0.5 * low,
          2 * high, low * (1 - 1e-9),           high * (1 + 1e-9)};
}

// Each pair alone, at margins around its exact distance. If the interval of a whole answer decides, so must this.
void try_alone(const engine::Engine& engine, std::span<const Result> exact_value, Precision precision, double rel_tol,
               Tried& tried) {
  for (std::uint32_t i = 0; i < exact_value.size(); ++i) {
    const BodyPair pair[] = {{2 * i, 2 * i + 1}};
    QueryView q;
    q.pairs = pair;
    q.precision = precision;
    q.rel_tol = rel_tol;
    for (const double margin : margins_around(exact_value[i])) {
      if (std::isinf(margin)) continue;
      q.margin = margin;
      const Row row = decide(engine, q);
      hold(row, exact_value.subspan(0), pair, std::span(&margin, 1), tried);
      QueryView whole = q;
      whole.all_pairs = false;
      whole.margin = 0;
      double lower = 0, upper = 0;
      ReplyView reply;
      reply.rows = 1;
      reply.lower = &lower;
      reply.upper = &upper;
      Job job = engine.start(whole, reply);
      while (!job.advance()) {
      }
      tried.avoidable += row.status == Status::kUnconverged && (lower > margin || upper <= margin);
    }
  }
}

// All separated pairs together, each with its own margin just below its distance; then one of them with a larger one,
// which has to be found. Margins as entries and as a list.
void try_together(const engine::Engine& engine, std::span<const Result> exact_value, Precision precision,
                  Tried& tried) {
  std::vector<BodyPair> pairs;
  std::vector<double> margins;
  for (std::uint32_t i = 0; i < exact_value.size(); ++i) {
    const double low = exact_value[i].distance.lower();
    if (!(low > 1e-6) || low > 1e9) continue;
    pairs.push_back({2 * i, 2 * i + 1});
    margins.push_back(low * (1 - 1e-3));
  }
  QueryView q;
  q.pairs = pairs;
  q.precision = precision;
  for (std::size_t raised = 0; raised <= pairs.size(); ++raised) {
    std::vector<double> own = margins;
    if (raised < pairs.size()) own[raised] *= 1.01;
    std::vector<MarginEntry> entries{{kEveryBody, kEveryBody, 1e10}};  // which later ones replace
    for (std::size_t i = 0; i < pairs.size(); ++i) entries.push_back({pairs[i].b, pairs[i].a, own[i]});
    q.margins = entries;
    q.pair_margins = {};
    if (!pairs.empty()) hold(decide(engine, q), exact_value, pairs, own, tried);
    q.margins = {};
    q.pair_margins = own;
    if (!pairs.empty()) hold(decide(engine, q), exact_value, pairs, own, tried);
  }
}

TEST(Margins, DecisionsAreProofs) {
  Tried tried;
  for (const CaseClass& cls : case_classes()) {
    std::vector<Case> cases;
    std::vector<Result> exact_value;
    for (int i = 0; i < (cls.cost > 3 ? 1 : 3); ++i) {
      cases.push_back(make_case(cls, kSeed, static_cast<std::uint64_t>(i)));
      exact_value.push_back(exact_answer(cases.back()));
    }
    for (const char* backend : {"cpu", "reference"}) {
      const Bench bench(cases, backend);
      for (const Precision precision : {Precision::kF64, Precision::kF32}) {
        for (const double rel_tol : {-1.0, 0.0}) try_alone(bench.engine(), exact_value, precision, rel_tol, tried);
        try_together(bench.engine(), exact_value, precision, tried);
      }
    }
  }
  std::printf("%d answers: %d beyond, %d within, %d open (%d avoidable), %d violations\n", tried.answers, tried.beyond,
              tried.within, tried.open, tried.avoidable, tried.violations);
  EXPECT_EQ(tried.violations, 0);
  EXPECT_LE(tried.avoidable, tried.answers / 1000) << "another way to the bounds may prove one step less";
  EXPECT_GT(tried.beyond, tried.answers / 10);
  EXPECT_GT(tried.within, tried.answers / 5);
  EXPECT_GT(tried.open, 100) << "no margin was at the exact distance";
}

}  // namespace
}  // namespace clearance::exact
