// Units of work on a team of threads, in slices.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <vector>

#include "engine/cost/team_cost.h"
#include "engine/query/run_units.h"

namespace clearance::test {
namespace {

using std::chrono::steady_clock;

// Units that take some microseconds each and are interrupted at the ends of slices.
struct Units {
  static constexpr std::uint64_t kSteps = 40;

  explicit Units(std::uint64_t count, int workers)
      : steps(count), done(count), states(static_cast<std::size_t>(workers)) {}

  bool run(std::uint64_t i, int worker, WorkMeter& meter) {
    std::atomic<int>& users = states[static_cast<std::size_t>(worker)];
    wrong += users.fetch_add(1) != 0;  // a worker's state is used by one thread at a time
    const bool has_ended = advance(i, meter);
    wrong += users.fetch_sub(1) != 1;
    return has_ended;
  }
  bool advance(std::uint64_t i, WorkMeter& meter) {
    for (std::uint64_t& step = steps[i]; step < kSteps; ++step) {
      if (meter.spent() > 0 && meter.is_over()) return ++interrupted, false;
      const auto until = steady_clock::now() + std::chrono::microseconds(2);
      while (steady_clock::now() < until) {
      }
      meter.count(1);
    }
    ++done[i];
    return true;
  }

  std::vector<std::uint64_t> steps;
  std::vector<int> done;
  std::vector<std::atomic<int>> states;
  std::atomic<std::uint64_t> interrupted{0}, wrong{0};
};

class RunUnits : public testing::Test {
 protected:
  void SetUp() override { team_cost().set({}, TeamCost::Clock::now()); }
  void TearDown() override { team_cost().set(TeamCost::kFirst, TeamCost::Clock::now()); }
};

TEST_F(RunUnits, EachUnitIsDoneOnceHoweverSlicesEnd) {
  constexpr std::uint64_t kCount = 300;
  std::atomic<std::uint64_t> teams{0};
  std::uint64_t interrupted = 0;
  for (const int workers : {1, 2, 4, 7})
    for (const std::uint64_t budget : {std::uint64_t{37}, std::uint64_t{400}, WorkBudget::kNoLimit}) {
      Units units(kCount, workers);
      UnitRunner runner(workers, &teams);
      std::uint64_t next = 0, slices = 0;
      bool is_done = false;
      while (!is_done && ++slices < 100'000) {
        team_cost().set({}, TeamCost::Clock::now());
        WorkBudget slice_budget;
        slice_budget.units = budget;
        WorkMeter slice(slice_budget);
        is_done = runner.run(
            next, kCount, slice, [&](std::uint64_t i, int w, WorkMeter& m) { return units.run(i, w, m); }, false);
      }
      ASSERT_TRUE(is_done) << workers << " workers, slices of " << budget;
      EXPECT_EQ(units.done, std::vector<int>(kCount, 1));
      EXPECT_EQ(units.wrong, 0u);
      interrupted += units.interrupted;
    }
  EXPECT_GT(teams, 0u);
  EXPECT_GT(interrupted, 100u);
}

TEST_F(RunUnits, AnExceptionOfAnyThreadReachesTheCaller) {
  for (const std::uint64_t bad : {0u, 150u, 299u}) {
    UnitRunner runner(4, nullptr);
    std::uint64_t next = 0;
    WorkMeter unlimited;
    Units units(300, 4);
    EXPECT_THROW(runner.run(
                     next, 300, unlimited,
                     [&](std::uint64_t i, int w, WorkMeter& m) {
                       if (i == bad) throw std::runtime_error("bad");
                       return units.run(i, w, m);
                     },
                     false),
                 std::runtime_error);
    EXPECT_EQ(units.wrong, 0u);
  }
}

}  // namespace
}  // namespace clearance::test
