// A wider tolerance needs no more work.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <vector>

#include "tests/engine/decision/least_distances.h"

namespace clearance::test {
namespace {

constexpr int kQueries = 1000;

/// Units of work of each state, queried alone.
std::vector<double> work_of(const engine::Engine& engine, const ArmStates& states, const Tolerance& tolerance) {
  std::vector<double> work;
  const std::size_t joints = states.joints.size();
  QueryView query = states.query;
  query.configuration_count = 1;
  query.abs_tol = tolerance.abs;
  query.rel_tol = tolerance.rel;
  query.positions = states.query.positions.first(joints);
  evaluate(engine, query);  // covers answer from the second time on
  for (std::size_t k = 0; k < kQueries; ++k) {
    query.positions = states.query.positions.subspan(k * joints, joints);
    const Answer answer = empty_answer(engine, query);
    Job job = engine.start(query, answer.view);
    while (!job.advance()) {
    }
    work.push_back(static_cast<double>(job.units()));
  }
  return work;
}

/// \param most_more states whose work may grow by more than a quarter: covers do not suffice, and the exact engine is
/// as fast for their few, small bodies
void wider_tolerances_need_no_more(const engine::Engine& engine, const char* name, Reduce reduce, double max_distance,
                                   int most_more) {
  ArmStates states = least_distances(engine.scene(), kQueries);
  states.query.reduce = reduce;
  states.query.max_distance = max_distance;
  for (const double abs : {0.5, 0.05, 0.02, 0.01, 0.005, 0.001}) {
    const std::vector<double> wide = work_of(engine, states, {abs, 0}), narrow = work_of(engine, states, {abs / 10, 0});
    double sum = 0, sum_narrow = 0;
    int more = 0;
    for (std::size_t k = 0; k < wide.size(); ++k) {
      sum += wide[k], sum_narrow += narrow[k];
      more += wide[k] > 1.25 * narrow[k] + 2;
    }
    std::printf("%s, %g m: %.2f of the work at a tenth; %d states more than 1.25\n", name, abs, sum / sum_narrow, more);
    EXPECT_LE(sum, sum_narrow) << name << ", " << abs;
    EXPECT_LE(more, most_more) << name << ", " << abs;
  }
}

// In one process: the covers take seconds.
TEST(WorkOfDistances, AWiderToleranceNeedsNoMore) {
  ::setenv("CLEARANCE_CACHE", "off", 1);
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const CoverEngines engines;
  ASSERT_TRUE(engines.with.wait_covers(kCoversPatience));
  wider_tolerances_need_no_more(engines.with, "min", Reduce::kMin, kInf, 30);
  wider_tolerances_need_no_more(engines.with, "nearest", Reduce::kNearest, kInf, 12);
  wider_tolerances_need_no_more(engines.with, "none", Reduce::kNone, kInf, 1);
  wider_tolerances_need_no_more(engines.with, "within", Reduce::kWithin, 0.15, 55);
  wider_tolerances_need_no_more(engines.without, "min without covers", Reduce::kMin, kInf, 0);
  wider_tolerances_need_no_more(engines.without, "nearest without covers", Reduce::kNearest, kInf, 0);
}

}  // namespace
}  // namespace clearance::test
