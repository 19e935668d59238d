// The queue of searches compared with a simple one: the least rank first, after any sequence of insertions and
// removals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>

#include "engine/base/best_first.h"
#include "tests/oracle/cases/cases.h"

namespace clearance {
namespace {

using Item = std::pair<std::uint32_t, std::uint32_t>;  // the rank, and an id that distinguishes items of equal rank

struct RankOf {
  unsigned __int128 operator()(const Item& x) const {
    return static_cast<unsigned __int128>(x.first / 4) << 64 | x.first % 4;  // either half decides
  }
};

TEST(BestFirst, GivesTheLeastRankOfWhatIsThere) {
  exact::Random random(11);
  BestFirst<Item, RankOf> queue;
  int of_same_rank = 0, taken = 0;
  std::size_t most = 0;
  for (int run = 0; run < 60; ++run) {
    queue.clear();
    std::set<Item> there;
    const double puts = run % 3 == 0 ? 0.5 : 0.7;
    for (std::uint32_t step = 0; step < 600; ++step) {
      ASSERT_EQ(queue.size(), there.size());
      ASSERT_EQ(queue.empty(), there.empty());
      if (there.empty() || random.chance(puts)) {
        const Item x{static_cast<std::uint32_t>(random.integer(0, run % 2 == 0 ? 60 : 100'000)), step};
        queue.put(x);
        there.insert(x);
        most = std::max(most, there.size());
        continue;
      }
      std::set<Item> others;
      queue.each_behind([&](const Item& x) { EXPECT_TRUE(others.insert(x).second) << "twice"; });
      const Item front = queue.front();
      const Item x = queue.pop();
      ++taken;
      ASSERT_EQ(x, front);
      ASSERT_EQ(x.first, there.begin()->first) << "run " << run << ", step " << step;
      ASSERT_EQ(there.erase(x), 1u) << "it was never put, or is taken twice";
      ASSERT_EQ(others, there);
      of_same_rank += !there.empty() && there.begin()->first == x.first;
    }
  }
  EXPECT_GT(taken, 5000);
  EXPECT_GT(of_same_rank, 500);
  EXPECT_GT(most, 200u);
}

}  // namespace
}  // namespace clearance
