// Each of the report's methods finds the same close pairs as brute force; the tree does the work that its text
// describes.
#include <gtest/gtest.h>

#include <limits>

#include "bench/report/close_pairs.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::baselines {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
using test::Random;

std::vector<Aabb> random_boxes(Random& random, std::size_t n, bool empty) {
  std::vector<Aabb> boxes;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3d low{random.uniform(0, 20), random.uniform(0, 20), random.uniform(0, 20)};
    boxes.push_back({low, low + Vec3d{random.uniform(0, 2), random.uniform(0, 2), random.uniform(0, 2)}});
    if (empty && random.below(20) == 0) boxes.back() = {{kInf, kInf, kInf}, {-kInf, -kInf, -kInf}};  // without a pose
    if (random.below(20) == 0 && i > 0) boxes.back() = boxes[i - 1];
  }
  return boxes;
}

class ClosePairs : public testing::TestWithParam<std::string> {};

TEST_P(ClosePairs, AreThoseOfBruteForce) {
  Random random(3);
  const auto brute = make_brute_force_broad_phase(), baseline = make_close_pairs(GetParam(), 3);
  EXPECT_EQ(baseline->name(), GetParam());
  std::size_t found = 0, at_infinity = 0, possible = 0;
  for (int round = 0; round < 40; ++round) {
    const std::size_t n = random.below(300);
    const std::vector<Aabb> some_empty = random_boxes(random, n, true), none_empty = random_boxes(random, n, false);
    for (const double margin : {0.0, 0.5, 5.0, kInf}) {
      const std::vector<Aabb>& boxes =
          margin < kInf ? some_empty : none_empty;    // at infinity brute force takes empty ones
      std::vector<BodyPair> expected, pairs{{7, 8}};  // existing entries must stay
      brute->candidates(boxes, margin, expected);
      baseline->candidates(boxes, margin, pairs);
      ASSERT_FALSE(pairs.empty());
      EXPECT_EQ(pairs[0], (BodyPair{7, 8}));
      pairs.erase(pairs.begin());
      EXPECT_EQ(pairs, expected) << "margin " << margin;
      (margin < kInf ? found : at_infinity) += expected.size();
      if (margin < kInf) possible += boxes.size() * (boxes.size() - 1) / 2;
    }
  }
  EXPECT_GT(found, 1000u);
  EXPECT_LT(found, possible / 2);
  EXPECT_GT(at_infinity, 100'000u);
}

INSTANTIATE_TEST_SUITE_P(All, ClosePairs, testing::ValuesIn(close_pairs_names()),
                         [](const auto& p) { return p.param; });

TEST(ClosePairsByName, AnUnknownNameIsRejected) {
  EXPECT_THROW(make_close_pairs("kd_tree"), std::invalid_argument);
}

TreeCounts counts_of(AabbTree::Insert insert, const std::vector<Aabb>& boxes) {
  AabbTree tree(insert);
  for (std::uint32_t i = 0; i < boxes.size(); ++i) tree.insert(i, boxes[i]);
  return tree.counts();
}

// Basis of docs/notes/report.md: with the printed heuristic the tree is nearly as deep as without it and becomes a
// list, since a box inside a node does not enlarge it. If branching costs the surface of the new parent, the same
// insertion is shallow.
TEST(AabbTree, ThePrintedHeuristicMakesAList) {
  constexpr std::uint64_t kBoxes = 500;
  Random random(5);
  std::vector<Aabb> boxes;
  for (std::uint64_t i = 0; i < kBoxes; ++i) {
    const Vec3d low{random.uniform(0, 20), random.uniform(0, 20), random.uniform(0, 20)};
    boxes.push_back({low, low + Vec3d{1, 1, 1}});
  }
  using Insert = AabbTree::Insert;
  const TreeCounts printed = counts_of(Insert::kCost, boxes), without = counts_of(Insert::kLeft, boxes),
                   corrected = counts_of(Insert::kNewParent, boxes);
  EXPECT_EQ(without.depth, kBoxes);
  EXPECT_EQ(without.visited_by_inserts, kBoxes * (kBoxes - 1) / 2);
  EXPECT_EQ(without.costs, 0u);
  EXPECT_GT(printed.depth, kBoxes / 2);
  EXPECT_GT(printed.visited_by_inserts, 50 * kBoxes);
  EXPECT_GT(printed.costs, 2 * printed.visited_by_inserts);
  EXPECT_LT(corrected.depth, 60u);
  EXPECT_LT(corrected.visited_by_inserts, 30 * kBoxes);
}

}  // namespace
}  // namespace clearance::baselines
