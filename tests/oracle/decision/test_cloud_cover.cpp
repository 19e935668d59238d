// Compares covers of clouds with exact geometry: grown points and voxels lie in balls on every level, and inner radii
// hold.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "engine/cover/cover.h"
#include "engine/geometry/cloud_geometry.h"
#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/decision/cover_points.h"

namespace clearance {
namespace {

constexpr double kEffort = 0.1;  // wider balls, made with the same proofs

struct CloudBody {
  std::string kind;
  std::vector<CloudPoint> points;
  float voxel;
  double radius;

  ConvexPartPtr part() const { return make_cloud_part(points, voxel, radius); }
};

std::vector<CloudPoint> around(exact::Random& random, int count, const Vec3d& centre, double size) {
  std::vector<CloudPoint> points;
  for (int i = 0; i < count; ++i) {
    const Vec3d p = centre + random.direction() * (size * random.uniform(0.9, 1));
    points.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
  }
  return points;
}

std::vector<CloudBody> bodies() {
  exact::Random random(61);
  return {{"points", around(random, 400, {0.1, 0, 0}, 0.3), 0, 0},
          {"grown", around(random, 400, {0, 0, 0.2}, 0.3), 0, 0.03125},
          {"voxels", around(random, 300, {0, 0.1, 0}, 0.2), 0.05f, 0},
          {"grown voxels", around(random, 300, {0.3, 0, 0}, 0.2), 0.03f, 0.0078125},
          {"one point", around(random, 1, {0.2, 0.1, 0}, 0.1), 0, 0.25},
          {"repeated", std::vector<CloudPoint>(30, {0.5f, 0.25f, 0}), 0, 0.125},
          {"far", around(random, 200, {300, -200, 100}, 0.2), 0.01f, 0.015625}};
}

Vec3q rational_of(const CloudPoint& p) {
  return rational({p[0], p[1], p[2]});
}

/// A corner of the box about a point, or the point, grown in some direction.
Vec3q farthest(const CloudBody& body, const CloudPoint& p, exact::Random& random) {
  Vec3q at = rational_of(p) + times(unit(random), mpq_class(body.radius));
  for (int k = 0; k < 3; ++k) at[k] += mpq_class(body.voxel) / (random.chance(0.5) ? 2 : -2);
  return at;
}

TEST(CloudCover, EveryCutHoldsTheElements) {
  exact::Random random(62);
  for (const CloudBody& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const ConvexPartPtr part = body.part();
    const auto cover = make_cover(std::span(&part, 1), nullptr, kEffort);
    ASSERT_TRUE(cover);
    for (const CloudPoint& p : body.points)
      for (int i = 0; i < 4; ++i) EXPECT_TRUE(has_path(*cover, farthest(body, p, random)));
  }
}

TEST(CloudCover, InnerRadiiHold) {
  int inside = 0, outside = 0;
  for (const CloudBody& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const ConvexPartPtr part = body.part();
    const auto cover = make_cover(std::span(&part, 1), nullptr, kEffort);
    ASSERT_TRUE(cover);
    for (const CoverBall& ball : all_balls(*cover)) {
      // The ball of half an edge and the radius about a point is in the body.
      const mpq_class least = mpq_class(body.radius) + mpq_class(body.voxel) / 2 - mpq_class(ball.inner);
      const Vec3q c = rational({ball.centre[0], ball.centre[1], ball.centre[2]});
      EXPECT_TRUE(least >= 0 &&
                  std::any_of(body.points.begin(), body.points.end(),
                              [&](const CloudPoint& p) { return squared(rational_of(p) - c) <= least * least; }))
          << ball.inner;
      ++(ball.inner > 0 ? inside : outside);
    }
  }
  EXPECT_GT(std::min(inside, outside), 200);
}

TEST(CloudCover, BallsOfPointsAreNarrow) {
  exact::Random random(63);
  const CloudBody body{"points", around(random, 400, {0, 0, 0}, 0.3), 0, 0.005};
  const ConvexPartPtr part = body.part();
  const auto cover = make_cover(std::span(&part, 1));
  ASSERT_TRUE(cover);
  EXPECT_LT(stand_out(*cover, 3).mean, 0.01) << "a ball holds one point or a few";
}

}  // namespace
}  // namespace clearance
