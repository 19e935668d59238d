// Blocks of pairs that are decided by boxes get the same rows as single pairs.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <thread>

#include "engine/reduce/box_cull.h"
#include "tests/engine/engine_test_util.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

Aabb random_box(Random& random) {
  if (random.below(10) == 0) return {{kInf, kInf, kInf}, {-kInf, -kInf, -kInf}};  // a body without a pose
  const double scale = random.below(2) ? 1 : std::pow(10, random.uniform(-12, 12));
  const Vec3d low{random.uniform(-scale, scale), random.uniform(-scale, scale), random.uniform(-scale, scale)};
  return {low, low + Vec3d{random.uniform(0, scale), random.uniform(0, scale), random.uniform(0, scale)}};
}

TEST(BoxColumns, GapsSideBySideHaveTheBitsOfOneAlone) {
  Random random(1);
  std::size_t apart = 0, touching = 0, nowhere = 0;
  for (int round = 0; round < 200; ++round) {
    const std::size_t n = 1 + random.below(70);
    std::vector<Aabb> a, b;
    for (std::size_t i = 0; i < n; ++i) a.push_back(random_box(random)), b.push_back(random_box(random));
    BoxColumns columns_a, columns_b;
    columns_a.assign(a), columns_b.assign(b);
    std::vector<double> one(n), two(n);
    box_gaps(a[0], columns_b.view(), n, one.data());
    box_gaps(columns_a.view(), columns_b.view(), n, two.data());
    for (std::size_t i = 0; i < n; ++i) {
      const double gap = certify_box_gap(a[i], b[i]);
      EXPECT_EQ(one[i], certify_box_gap(a[0], b[i]));
      EXPECT_EQ(two[i], gap);
      (gap == kInf ? nowhere : gap > 0 ? apart : touching) += 1;
    }
  }
  EXPECT_GT(apart, 100u);
  EXPECT_GT(touching, 100u);
  EXPECT_GT(nowhere, 100u);
}

// The same query for few pairs at a time, for which no block is made.
void expect_rows_of_few(const engine::Engine& engine, const QueryView& query, const std::vector<BodyPair>& pairs,
                        std::array<std::uint64_t, 8>& seen) {
  const Answer all = evaluate(engine, query);
  ASSERT_EQ(all.size.pairs, pairs.size());
  const std::size_t few = engine.scene().bodies().size() / 2 - 1;
  for (std::size_t begin = 0; begin < pairs.size(); begin += few) {
    const std::size_t count = std::min(few, pairs.size() - begin);
    QueryView part = query;
    part.all_pairs = false;
    part.pairs = std::span(pairs).subspan(begin, count);
    const Answer answer = evaluate(engine, part);
    for (std::uint64_t k = 0; k < all.size.configurations; ++k) {
      Answer row_k;  // of this configuration
      row_k.view = answer.view;
      const std::uint64_t skip = k * count;
      const auto ahead = [&](auto*& column, std::uint64_t width) {
        if (column) column += skip * width;
      };
      ReplyView& v = row_k.view;
      ahead(v.distance, 1), ahead(v.lower, 1), ahead(v.upper, 1), ahead(v.status, 1), ahead(v.flags, 1);
      ahead(v.point_a, 3), ahead(v.point_b, 3), ahead(v.normal, 3), ahead(v.parts, 2), ahead(v.gradient, 12);
      ahead(v.pair, 1), ahead(v.configuration, 1), ahead(v.points32, 6), ahead(v.bounds, 2);
      const auto part_seen = expect_same_rows(all, k * pairs.size() + begin, row_k, count);
      for (std::size_t s = 0; s < seen.size(); ++s) seen[s] += part_seen[s];
      if (::testing::Test::HasFatalFailure()) return;
    }
  }
}

TEST(BoxCull, RowsAreThoseOfPairsOneByOne) {
  Random random(2);
  engine::Engine engine(mixed_scene(60, 6, 4));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const BodyPose bad[] = {{7, {{nan, 0, 0}}}, {23, {{1, 2, 3}, 2, 0.5, 0, 0}}};  // one unusable, one renormalised
  engine.set_poses(bad);
  std::vector<BodyPair> shuffled = engine.pairs({});
  for (std::size_t i = 0; i + 1 < shuffled.size(); ++i)
    if (random.below(8) == 0) std::swap(shuffled[i], shuffled[i + random.below(shuffled.size() - i)]);
  for (std::size_t i = 0; i < 20; ++i)
    shuffled.insert(shuffled.begin() + random.below(shuffled.size()), {static_cast<std::uint32_t>(i), 1000});
  std::vector<std::uint32_t> moved{3, 8, 12, 23};
  std::array<std::uint64_t, 8> seen{};
  for (const std::uint32_t configurations : {0u, 1u, 5u, 70u})
    for (const bool listed : {false, true})
      for (const double max_distance : {0.0, 0.7, 3.0})
        for (const std::uint32_t fields : {kAllFields, kFloat32 | kFieldStatus | kFieldFlags | kFieldPieces}) {
          std::vector<Pose> poses;
          for (std::size_t i = 0; i < configurations * moved.size(); ++i) poses.push_back(random.pose(6));
          if (configurations > 1) poses[5].qx = nan;
          QueryView query;
          query.max_distance = max_distance;
          query.fields = fields;
          query.configuration_count = configurations;
          if (configurations > 0) query.bodies = moved;
          query.configurations = poses;
          query.all_pairs = !listed;
          query.pairs = shuffled;
          QueryView only_pairs = query;
          only_pairs.configurations = {};
          const std::vector<BodyPair> pairs = listed ? shuffled : engine.pairs(only_pairs);
          expect_rows_of_few(engine, query, pairs, seen);
          if (HasFatalFailure())
            FAIL() << configurations << " configurations, listed " << listed << ", within " << max_distance;
        }
  for (const Status status : {Status::kOk, Status::kOverlap, Status::kBeyond, Status::kBadPose, Status::kUnknownBody})
    EXPECT_GT(seen[static_cast<std::size_t>(status)], 100u) << "status " << int(status) << " was not met";
}

}  // namespace
}  // namespace clearance::test
