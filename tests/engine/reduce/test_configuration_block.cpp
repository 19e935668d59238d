// Many configurations reduced in parallel: each answer equals that of its configuration alone, and that of all pairs.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/reduce/configuration_block.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {
namespace {

/// Random configurations of some bodies of a scene.
struct Moves {
  std::vector<std::uint32_t> bodies;
  std::uint32_t count;
  std::vector<Pose> poses;

  Moves(std::vector<std::uint32_t> moved, std::uint32_t configurations, double box, std::uint64_t seed)
      : bodies(std::move(moved)), count(configurations) {
    Random random(seed);
    for (std::size_t i = 0; i < count * bodies.size(); ++i) poses.push_back(random.pose(box));
  }
  QueryView query(std::uint32_t first, std::uint32_t configurations) const {
    QueryView q;
    q.fields = kAllFields;
    q.bodies = bodies;
    q.configurations = std::span(poses).subspan(first * bodies.size(), configurations * bodies.size());
    q.configuration_count = configurations;
    return q;
  }
  QueryView query() const { return query(0, count); }
};

/// An answer from a row on; its configurations are not compared.
Answer rows_from(const Answer& answer, std::uint64_t row) {
  Answer rest;
  rest.view = answer.view;
  for_each_column(
      [&](auto*& column, std::size_t width) {
        if (column) column += row * width;
      },
      rest.view);
  rest.view.configuration = nullptr;
  return rest;
}

// Pairs that the parts' boxes skip change neither the rows of near pairs nor their selection.
TEST(ConfigurationBlock, WithinGivesTheRowsOfAllPairs) {
  const Moves moves({0, 3, 7, 13}, 60, 1.5, 1);
  const engine::Scene scene = decomposed_scene(30, 1.5, 7);
  for (const bool uncertainties : {false, true}) {
    const engine::Engine engine(uncertainties ? with_uncertainty(scene) : scene, {.threads = 1});
    QueryView q = moves.query();
    q.max_distance = 0.25;
    const Answer dense = evaluate(engine, q);
    q.reduce = Reduce::kWithin;
    const Answer within = evaluate(engine, q);
    std::uint64_t found = 0;
    std::array<std::uint64_t, 8> seen{};
    for (std::uint64_t i = 0; i < dense.info.rows; ++i) {
      if (static_cast<Status>(dense.view.status[i]) == Status::kBeyond) continue;
      ASSERT_LT(found, within.info.rows);
      const Answer wanted = rows_from(dense, i);
      const auto one = expect_same_rows(wanted, 0, rows_from(within, found++), 1);
      for (std::size_t s = 0; s < seen.size(); ++s) seen[s] += one[s];
    }
    EXPECT_EQ(found, within.info.rows);
    EXPECT_GT(count_of(seen, Status::kOk), 100u);
    EXPECT_GT(count_of(seen, Status::kOverlap), 100u);
    EXPECT_LT(found, dense.info.rows / 2);
  }
}

// The same for cut-offs that shrink while candidates are answered.
TEST(ConfigurationBlock, MinGivesTheRowOfItsPair) {
  const Moves moves({0, 3, 7, 13}, 80, 4, 2);
  const engine::Scene scene = decomposed_scene(30, 4, 8);
  for (const bool uncertainties : {false, true}) {
    const engine::Engine engine(uncertainties ? with_uncertainty(scene) : scene, {.threads = 1});
    QueryView q = moves.query();
    const Answer dense = evaluate(engine, q);
    const std::uint64_t pairs = dense.info.rows / moves.count;
    q.reduce = Reduce::kMin;
    const Answer min = evaluate(engine, q);
    ASSERT_EQ(min.info.rows, moves.count);
    std::array<std::uint64_t, 8> seen{};
    for (std::uint64_t k = 0; k < moves.count; ++k) {
      const double *upper = dense.view.upper + k * pairs, *lower = dense.view.lower + k * pairs;
      const std::uint64_t winner = static_cast<std::uint64_t>(std::min_element(upper, upper + pairs) - upper);
      const double least = *std::min_element(lower, lower + pairs);
      Answer wanted = rows_from(dense, k * pairs + winner), found = rows_from(min, k);
      EXPECT_GE(found.view.lower[0], least);
      EXPECT_LE(found.view.lower[0], wanted.view.lower[0]);
      // If another pair's interval begins lower, boxes may give a better bound, as they did before.
      if (least < wanted.view.lower[0]) wanted.view.lower = found.view.lower = nullptr;
      const auto one = expect_same_rows(wanted, 0, found, 1);
      for (std::size_t s = 0; s < seen.size(); ++s) seen[s] += one[s];
    }
    EXPECT_GT(count_of(seen, Status::kOk), 20u);
    EXPECT_GT(count_of(seen, Status::kOverlap), 10u);
  }
}

TEST(ConfigurationBlock, EachConfigurationAnswersAsItDoesAlone) {
  Moves moves({1, 5, 8}, 70, 3, 3);
  moves.poses[3 * 11 + 1].translation.x = std::nan("");  // of configurations among good ones
  moves.poses[3 * 69 + 2].qw = std::numeric_limits<double>::infinity();
  for (const int threads : {1, 3}) {
    const engine::Engine engine(decomposed_scene(25, 3, 9), {.threads = threads});
    for (const Reduce reduce : {Reduce::kMin, Reduce::kWithin, Reduce::kNearest})
      for (const double max_distance : {0.3, std::numeric_limits<double>::infinity()}) {
        QueryView q = moves.query();
        q.reduce = reduce;
        q.max_distance = max_distance;
        const Answer all = evaluate(engine, q, std::chrono::microseconds(20));
        std::uint64_t row = 0, bad = 0;
        for (std::uint32_t k = 0; k < moves.count; ++k) {
          QueryView alone = moves.query(k, 1);
          alone.reduce = reduce;
          alone.max_distance = max_distance;
          const Answer one = evaluate(engine, alone);
          ASSERT_LE(row + one.info.rows, all.info.rows);
          for (std::uint64_t i = 0; i < one.info.rows; ++i) EXPECT_EQ(all.view.configuration[row + i], k);
          for (std::uint64_t i = 0; i < one.info.rows; ++i)
            bad += (one.view.flags[i] & kFlagIncomplete) || one.view.status[i] == std::uint8_t(Status::kBadPose);
          expect_same_rows(rows_from(all, row), 0, rows_from(one, 0), one.info.rows);
          row += one.info.rows;
        }
        EXPECT_EQ(row, all.info.rows);
        EXPECT_GE(bad, 2u);
      }
  }
}

// A slanted rod whose box is the nearest, and is far; balls at growing distances, all nearer than the rod: the first of
// them shows that the others need not be evaluated.
TEST(ConfigurationBlock, MinEndsWhereBoxesAreFartherThanWhatWasFound) {
  constexpr int kBalls = 40;
  engine::Scene scene;
  scene.add_sphere("moved", 0.1, {.pose = Pose{}});
  const double s = std::sin(std::atan(1) / 2);
  scene.add_box("rod", {12, 0.02, 0.02}, {.pose = Pose{{4.4, 4.4, 0}, std::sqrt(1 - s * s), 0, 0, -s}});
  for (int i = 0; i < kBalls; ++i)
    scene.add_sphere("ball" + std::to_string(i), 0.1, {.pose = Pose{{-1.0 - 0.1 * i, 0, 0}}});
  const engine::Engine engine(std::move(scene), {.threads = 1});
  Moves moves({0}, 20, 0.01, 4);
  QueryView q = moves.query();
  const Answer dense = evaluate(engine, q);
  const std::uint64_t pairs = dense.info.rows / moves.count;
  for (int i = 0; i < kBalls; ++i)
    ASSERT_LT(dense.view.upper[1 + i], dense.view.lower[0]) << "the rod is farther than all balls";
  q.reduce = Reduce::kMin;
  const Answer min = evaluate(engine, q);
  EXPECT_LE(min.info.pairs_evaluated, 3 * moves.count) << "the rod and two balls";
  EXPECT_GE(min.info.pairs_evaluated, 2 * moves.count) << "the rod's box was not the nearest";
  for (std::uint64_t k = 0; k < moves.count; ++k) {
    EXPECT_EQ(min.view.lower[k], dense.view.lower[k * pairs + 1]);
    EXPECT_EQ(min.view.upper[k], dense.view.upper[k * pairs + 1]);
  }
}

TEST(ConfigurationBlock, HasAsManyConfigurationsAsItsMemoryAllows) {
  const engine::Scene scene = decomposed_scene(10, 3, 9);
  const auto most = [&](std::uint64_t configurations, std::uint64_t pairs, std::vector<std::uint32_t> moved,
                        int workers, bool by_tree = false, bool with_boxes = true) {
    Plan plan;
    plan.size.configurations = configurations;
    plan.size.pairs = pairs;
    plan.moved = std::move(moved);
    return ConfigurationBlock::most(scene, plan, by_tree, with_boxes, workers);
  };
  EXPECT_EQ(most(1, 0, {}, 1), 1u);
  EXPECT_EQ(most(4096, 138, {0}, 1), 256u);
  EXPECT_EQ(most(4096, 138, {0}, 8), 128u);
  EXPECT_EQ(most(4096, 138, {0}, 1, true), 1u) << "with a tree";
  EXPECT_EQ(most(4096, 16384, {0}, 1), 4u) << "pairs";
  EXPECT_EQ(most(4096, 138, {0}, 1, false, false), 7u) << "each makes its own boxes";
  EXPECT_EQ(most(4096, 138, {2, 3, 6, 7}, 1), 8192u / (1 + 8 + 27 + 17 + 40)) << "pieces";
  EXPECT_EQ(most(10, 138, {0}, 4), 1u);
}

}  // namespace
}  // namespace clearance::test
