// The implicit pair table, compared with a list made from the definition.
#include <gtest/gtest.h>

#include <set>

#include "engine/selection/pair_lister.h"
#include "engine/state/pair_table.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

TEST(PairTable, ListsWhatTheRuleSaysInOrder) {
  Random random(31);
  int with_statics = 0, with_ignored = 0, with_parents = 0;
  for (int round = 0; round < 60; ++round) {
    engine::Scene scene;
    const int n = round == 0 ? 60 : 1 + static_cast<int>(random.below(25));
    std::vector<std::uint32_t> parents;
    for (int i = 0; i < n; ++i) {
      engine::Scene::BodyOptions options;
      options.pose = Pose{};
      options.is_static = random.below(3) == 0;
      scene.add_sphere("b" + std::to_string(i), 1, options);
      const bool follows = i > 0 && !options.is_static && random.below(4) == 0;
      parents.push_back(follows ? static_cast<std::uint32_t>(random.below(static_cast<std::uint64_t>(i))) : kNone);
      with_statics += options.is_static;
      with_parents += follows;
    }
    for (int k = 0; k < n / 2; ++k) {
      const auto a = random.below(n), b = random.below(n);
      if (a == b) continue;
      scene.ignore("b" + std::to_string(a), "b" + std::to_string(b));
      ++with_ignored;
    }
    const std::set<std::pair<std::uint32_t, std::uint32_t>> ignored(scene.ignored().begin(), scene.ignored().end());
    std::vector<BodyPair> expected;
    for (std::uint32_t a = 0; a < static_cast<std::uint32_t>(n); ++a)
      for (std::uint32_t b = a + 1; b < static_cast<std::uint32_t>(n); ++b)
        if (!(scene.bodies()[a].is_static && scene.bodies()[b].is_static) && parents[a] != b && parents[b] != a &&
            !ignored.count({a, b}))
          expected.push_back({a, b});
    const auto shared = std::make_shared<const PairTable>(scene, parents, IgnoredPairs(scene).all());
    const PairTable& table = *shared;
    ASSERT_EQ(table.size(), expected.size());
    std::vector<BodyPair> listed(table.size());
    table.copy(0, table.size(), listed.data());
    EXPECT_EQ(listed, expected);
    const auto is_table = [&](std::span<const BodyPair> pairs) {
      QueryView query;
      query.all_pairs = false;
      query.pairs = pairs;
      PairLister lister(query, scene, shared, {});
      WorkMeter unlimited;
      EXPECT_TRUE(lister.advance(unlimited));
      const PairList list = lister.take();
      EXPECT_EQ(list.size(), pairs.size());
      return list.is_whole_table();
    };
    EXPECT_TRUE(is_table(expected));
    if (!expected.empty()) {
      std::swap(listed.front(), listed.back());
      EXPECT_EQ(is_table(listed), expected.size() == 1);
      listed = expected;
      listed[random.below(listed.size())].b += 1;
      EXPECT_FALSE(is_table(listed));
      EXPECT_FALSE(is_table(std::span(expected).first(expected.size() - 1)));
    }
    for (std::size_t begin = 0; begin < expected.size(); begin += 1 + random.below(9)) {
      const std::size_t count = random.below(expected.size() - begin + 1);
      std::vector<BodyPair> part(count);
      table.copy(begin, count, part.data());
      EXPECT_TRUE(std::equal(part.begin(), part.end(), expected.begin() + static_cast<std::ptrdiff_t>(begin)));
    }
    for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(table.position(expected[i]), i);
    const std::set<BodyPair> enabled(expected.begin(), expected.end());
    for (std::uint32_t a = 0; a < static_cast<std::uint32_t>(n) + 2; ++a)
      for (std::uint32_t b = 0; b < static_cast<std::uint32_t>(n) + 2; ++b)
        EXPECT_EQ(table.enabled(a, b), enabled.count({std::min(a, b), std::max(a, b)}) == 1);
  }
  EXPECT_GT(with_statics, 50);
  EXPECT_GT(with_ignored, 50);
  EXPECT_GT(with_parents, 50);
}

}  // namespace
}  // namespace clearance::test
