// Bodies of several convex parts: the order of their part pairs, and the search of a single thread compared with that
// of the engine, which works in rounds.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "engine/narrow/narrow_phase.h"
#include "engine/narrow/part_search.h"
#include "tests/engine/engine_test_util.h"

namespace clearance {
namespace {

using test::Random;

constexpr double kInf = std::numeric_limits<double>::infinity();

// Corners on a coarse grid, so that many gaps are equal.
std::vector<Aabb> random_boxes(std::size_t count, Random& random) {
  std::vector<Aabb> boxes;
  for (std::size_t i = 0; i < count; ++i) {
    Aabb box;
    for (int k = 0; k < 3; ++k) {
      box.low[k] = static_cast<double>(random.below(12));
      box.high[k] = box.low[k] + static_cast<double>(random.below(4));
    }
    boxes.push_back(box);
  }
  return boxes;
}

template <int kCount>
void expect_order(const std::vector<Aabb>& a, const std::vector<Aabb>& b, std::size_t& ties) {
  std::vector<PartPair> all;
  for (std::uint32_t i = 0; i < a.size(); ++i)
    for (std::uint32_t j = 0; j < b.size(); ++j) all.push_back({certify_box_gap(a[i], b[j]), i, j});
  std::sort(all.begin(), all.end(), goes_before);
  const auto of_a = [&](std::uint32_t i) { return a[i]; };
  const auto of_b = [&](std::uint32_t i) { return b[i]; };
  NearestConvexParts<kCount, decltype(of_a), decltype(of_b)> nearest(of_a, static_cast<std::uint32_t>(a.size()), of_b,
                                                                     static_cast<std::uint32_t>(b.size()));
  PartPair p;
  for (std::size_t i = 0; i < all.size(); ++i) {
    ASSERT_TRUE(nearest.next(p)) << i << " of " << all.size();
    ASSERT_TRUE(p.gap == all[i].gap && p.a == all[i].a && p.b == all[i].b) << i << " of " << all.size();
    ties += i > 0 && all[i].gap == all[i - 1].gap;
  }
  EXPECT_FALSE(nearest.next(p));
}

TEST(PartSearch, FindsPartPairsInTheirOrder) {
  Random random(1);
  std::size_t ties = 0;
  for (const std::size_t count_a : {1u, 2u, 7u, 40u})
    for (const std::size_t count_b : {1u, 3u, 8u, 33u}) {
      const std::vector<Aabb> a = random_boxes(count_a, random), b = random_boxes(count_b, random);
      expect_order<1>(a, b, ties);
      expect_order<8>(a, b, ties);
    }
  EXPECT_GT(ties, 1000u);
}

// The engine answers the pairs of a round in parallel lanes, and sorts all gaps at once.
TEST(PartSearch, EndsAsTheEnginesRoundsDo) {
  const engine::Scene scene = test::decomposed_scene(60, 1.2, 2);
  std::vector<BodyPlacement> placed;
  std::vector<std::vector<Aabb>> boxes;
  for (const Body& body : scene.bodies()) {
    placed.push_back(place(&*body.pose, nullptr));
    boxes.emplace_back();
    for (const ConvexPartPtr& part : body.parts)
      boxes.back().push_back(certify_box(*part, placed.back().pose.R_wb, placed.back().pose.t_w));
  }
  const engine::Engine engine(test::decomposed_scene(60, 1.2, 2), {"cpu"});
  std::set<std::uint8_t> statuses;
  std::size_t searched = 0, long_searches = 0;
  for (const double max_distance : {kInf, 0.3}) {
    QueryView q;
    q.fields = test::kAllFields;
    q.max_distance = max_distance;
    const test::Answer answer = test::evaluate(engine, q);
    const std::vector<BodyPair> pairs = engine.pairs(q);
    for (std::size_t row = 0; row < pairs.size(); ++row) {
      const auto [a, b] = pairs[row];
      if (answer.view.parts[2 * row] == kNone) continue;  // body boxes are beyond max_distance
      const auto of_a = [&](std::uint32_t i) { return boxes[a][i]; };
      const auto of_b = [&](std::uint32_t i) { return boxes[b][i]; };
      NearestConvexParts<8, decltype(of_a), decltype(of_b)> nearest(of_a, static_cast<std::uint32_t>(boxes[a].size()),
                                                                    of_b, static_cast<std::uint32_t>(boxes[b].size()));
      PartSearch search;
      PartPair best{};
      NarrowLimits limits;
      std::size_t looks = 0;
      const PartEnd end = search_parts(search, max_distance, nearest, [&](const PartPair& p, double cut_off) {
        ++looks;
        limits.max_distance = cut_off;
        const NarrowAnswer n = narrow_phase(*scene.bodies()[a].parts[p.a], placed[a].pose,
                                            *scene.bodies()[b].parts[p.b], placed[b].pose, limits);
        if (search.take(p.gap, n.bounds.lower, n.bounds.upper)) best = p;
        return n.bounds.upper <= 0 ? PartEnd::kOverlap : PartEnd::kApart;
      });
      ++searched;
      long_searches += looks > 7;
      statuses.insert(answer.view.status[row]);
      EXPECT_EQ(answer.view.lower[row], std::max(search.lower, 0.0)) << row;
      EXPECT_EQ(answer.view.upper[row], std::max(search.upper, 0.0)) << row;
      EXPECT_EQ(answer.view.parts[2 * row], best.a) << row;
      EXPECT_EQ(answer.view.parts[2 * row + 1], best.b) << row;
      EXPECT_EQ(end == PartEnd::kOverlap, answer.view.status[row] == static_cast<std::uint8_t>(Status::kOverlap))
          << row;
    }
  }
  EXPECT_GT(searched, 1500u);
  EXPECT_GT(long_searches, 50u);
  for (const Status s : {Status::kOk, Status::kOverlap, Status::kBeyond})
    EXPECT_TRUE(statuses.contains(static_cast<std::uint8_t>(s)));
}

ConvexPartPtr box_of(const Vec3d& size) {
  engine::Scene scene;
  scene.add_box("box", size, {});
  return scene.bodies()[0].parts[0];
}
double gap_of(const ConvexPart& a, const PoseMatrix& at_a, const ConvexPart& b, const PoseMatrix& at_b, double enough) {
  return certify_parts_gap(a, b, at_a.R_wb.transpose_times(at_b.R_wb), at_a.R_wb.transpose_times(at_b.t_w - at_a.t_w),
                           enough);
}

// The bound by which rounds drop part pairs, near the origin and far from it.
TEST(PartSearch, BoundOfPartsIsBelowTheirDistance) {
  const engine::Scene scene = test::decomposed_scene(60, 1.2, 2);
  std::vector<ConvexPartPtr> parts{make_primitive_part({Primitive::Kind::kCylinder, {0.2, 0.2, 0.5}}, 0.1),
                                   make_primitive_part({Primitive::Kind::kEllipsoid, {0.1, 0.3, 0.6}}),
                                   make_primitive_part({Primitive::Kind::kCone, {0.3, 0.3, 0.2}}),
                                   box_of({0.8, 0.4, 0.6})};
  for (const Body& body : scene.bodies()) parts.insert(parts.end(), body.parts.begin(), body.parts.end());
  Random random(3);
  int apart = 0, above_world_boxes = 0, from_balls_alone = 0;
  for (int i = 0; i < 2000; ++i) {
    const ConvexPart &a = *parts[random.below(parts.size())], &b = *parts[random.below(parts.size())];
    const Vec3d far = i % 2 ? Vec3d{1e7, -3e6, 2e5} : Vec3d{0, 0, 0};
    Pose X_a = random.pose(1.5), X_b = random.pose(1.5);
    X_a.translation += far;
    X_b.translation += far;
    const PoseMatrix at_a = place(&X_a, nullptr).pose, at_b = place(&X_b, nullptr).pose;
    const double gap = gap_of(a, at_a, b, at_b, kInf);
    ASSERT_LE(gap, std::max(narrow_phase_reference(a, at_a, b, at_b, {}).bounds.upper, 0.0)) << i;
    apart += gap > 0;
    above_world_boxes +=
        gap > certify_box_gap(certify_box(a, at_a.R_wb, at_a.t_w), certify_box(b, at_b.R_wb, at_b.t_w));
    from_balls_alone += gap_of(a, at_a, b, at_b, 0) < gap;
  }
  EXPECT_GT(apart, 500);
  EXPECT_GT(above_world_boxes, 500);
  EXPECT_GT(from_balls_alone, 100);
}

// Faces 2^-20 m apart, a kilometre from their bodies' origins: turning the centres there is what errs most.
TEST(PartSearch, BoundOfPartsAllowsForRounding) {
  std::vector<Vec3d> corners = box_of({1.4, 0.6, 0.2})->vertices;
  for (Vec3d& v : corners) v += Vec3d{1000, -300, 200};
  const ConvexPartPtr box = make_convex_part(corners);
  NarrowLimits limits;
  limits.rel_tol = 1e-20;
  Random random(4);
  for (int i = 0; i < 1000; ++i) {
    const Pose X_a = random.pose(2);
    const PoseMatrix at_a = place(&X_a, nullptr).pose;
    Pose X_b = X_a;
    X_b.translation += at_a.R_wb * Vec3d{1.4 + 0x1p-20, 0, 0};
    const PoseMatrix at_b = place(&X_b, nullptr).pose;
    const NarrowAnswer exact = narrow_phase_reference(*box, at_a, *box, at_b, limits);
    const double gap = gap_of(*box, at_a, *box, at_b, kInf);
    ASSERT_LE(gap, exact.bounds.lower) << i;
    ASSERT_GT(gap, exact.bounds.upper - 1e-10) << i;
  }
}

}  // namespace
}  // namespace clearance
