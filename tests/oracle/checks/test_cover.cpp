// Compares the bounds of covers with exact distances of points: of hulls, unions, flat and rounded parts and round cores.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

#include "engine/cover/cover.h"
#include "engine/hull/hull.h"
#include "engine/hull/primitive.h"
#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/exact/exact_distance.h"

namespace clearance {
namespace {

using exact::Random;
using exact::Solid;

/// A body as its cover sees it, and as the oracle does.
struct Body {
  std::string kind;
  std::vector<ConvexPartPtr> parts;
  std::vector<exact::SolidPtr> solids;
};

Body body_of(std::string kind, std::vector<exact::SolidPtr> solids) {
  Body body{std::move(kind), {}, std::move(solids)};
  for (const auto& solid : body.solids) body.parts.push_back(make_hull_part(solid->vertices, {}, solid->radius));
  return body;
}

exact::SolidPtr moved(const exact::SolidPtr& solid, const Vec3d& by) {
  std::vector<Vec3d> vertices = solid->vertices;
  for (Vec3d& v : vertices) v += by;
  return exact::solid(std::move(vertices), solid->radius);
}

Body any_body(Random& random, int kind) {
  switch (kind) {
    case 0:
      return body_of("hull", {exact::solid(exact::ordinary(random))});
    case 1:
      return body_of("prism", {exact::faced(random)});
    case 2:
      return body_of("needle", {exact::needle(random)});
    case 3:
      return body_of("plate", {exact::plate(random)});
    case 4:
      return body_of("flat", {exact::flat(random)});
    case 5:
      return body_of("line", {exact::line(random)});
    case 6:
      return body_of("sphere", {exact::solid({{0.1, -0.2, 0.3}}, 0.25)});
    case 7:
      return body_of("capsule", {exact::solid({{0, 0, -0.4}, {0, 0, 0.4}}, 0.1)});
    case 8:
      return body_of("rounded", {exact::solid(exact::ordinary(random), 0.05)});
    case 9:
      return body_of("sliver", {exact::sliver(random)});
    default:
      return body_of("union", {exact::solid(exact::ordinary(random)), moved(exact::faced(random), {0.7, 0.2, -0.1})});
  }
}

double reach_of(const Body& body) {
  double reach = 0;
  for (const ConvexPartPtr& part : body.parts) reach = std::max(reach, part->rho + part->radius);
  return reach;
}

/// A point in, on or near the body, or farther away.
Vec3d point_near(Random& random, const Body& body) {
  const auto& solid = *body.solids[random.integer(0, static_cast<int>(body.solids.size()) - 1)];
  const int corners = random.integer(1, 4);
  Vec3d p{0, 0, 0};
  for (int k = 0; k < corners; ++k)
    p += solid.vertices[random.integer(0, static_cast<int>(solid.vertices.size()) - 1)] * (1.0 / corners);
  const double away = random.chance(0.3) ? 0 : reach_of(body) * std::pow(10, random.uniform(-9, 0.3));
  for (int k = 0; k < 3; ++k) p[k] += away * random.uniform(-1, 1);
  return p;
}

/// Whether `x` is above the exact distance of the point from the body, and so no lower bound.
bool exceeds(const std::vector<exact::Value>& distances, double x) {
  bool all = x > 0;  // a body that contains the point is at distance 0
  for (const exact::Value& d : distances) all = all && d.compare(x) < 0;
  return all;
}
/// Whether `x` is below the exact distance, and so no upper bound.
bool falls_short(const std::vector<exact::Value>& distances, double x) {
  bool all = true;
  for (const exact::Value& d : distances) all = all && d.compare(x) > 0;
  return all && x >= 0;
}

double down(double x) {
  return std::nextafter(x, -1e300) - 1e-300;
}
double up(double x) {
  return std::nextafter(x, 1e300) + 1e-300;
}

struct Findings {
  int points = 0, inside = 0, near = 0, wrong_lower = 0, wrong_upper = 0, decided = 0;
};

/// The least outer bound over a complete cut: each ball is replaced by its children with some probability.
double least_of_cut(const Cover& cover, std::uint32_t ball, const Vec3d& p, Random& random, double descend) {
  const std::uint32_t begin = cover.first_child[ball], end = cover.first_child[ball + 1];
  const CoverBall& b = cover.balls[ball];
  if (begin == end || !random.chance(descend)) {
    const Vec3d d = p - Vec3d{b.centre[0], b.centre[1], b.centre[2]};
    return down(
        static_cast<double>(std::sqrt(static_cast<long double>(d.x) * d.x + static_cast<long double>(d.y) * d.y +
                                      static_cast<long double>(d.z) * d.z)) -
        b.outer);
  }
  double least = INFINITY;
  for (std::uint32_t child = begin; child < end; ++child)
    least = std::min(least, least_of_cut(cover, child, p, random, descend));
  return least;
}

void try_point(const Cover& cover, const std::vector<exact::Value>& distances, const Vec3d& p, Random& random,
               Findings& found) {
  ++found.points;
  found.inside += !exceeds(distances, 1e-300) && distances[0].sign <= 0;
  for (const double descend : {0.0, 0.3, 0.6, 0.9, 1.0})
    found.wrong_lower += exceeds(distances, least_of_cut(cover, 0, p, random, descend));
  double least = INFINITY;
  for (const CoverBall& b : cover.balls) {
    const Vec3d d = p - Vec3d{b.centre[0], b.centre[1], b.centre[2]};
    least = std::min(least, up(std::max(0.0, up(norm(d) * (1 + 1e-15)) - b.inner)));
  }
  found.wrong_upper += falls_short(distances, least);
}

Findings try_body(const Body& body, const Cover& cover, int points, Random& random) {
  Findings found;
  for (int i = 0; i < points; ++i) {
    const Vec3d p = point_near(random, body);
    std::vector<exact::Value> distances;
    for (const auto& solid : body.solids)
      distances.push_back(
          exact::exact_distance({solid->vertices, solid->radius}, Pose{}, {std::span(&p, 1), 0}, Pose{}, false)
              .distance);
    try_point(cover, distances, p, random, found);
  }
  return found;
}

constexpr int kKinds = 11;

TEST(Cover, BoundsTheDistancesOfPoints) {
  Random random(44);
  Findings all;
  for (int kind = 0; kind < kKinds; ++kind) {
    const Body body = any_body(random, kind);
    SCOPED_TRACE(body.kind);
    const std::optional<Cover> cover = make_cover(body.parts);
    ASSERT_TRUE(cover);
    const Findings found = try_body(body, *cover, 300, random);
    EXPECT_EQ(found.wrong_lower, 0);
    EXPECT_EQ(found.wrong_upper, 0);
    all.points += found.points;
    all.inside += found.inside;
  }
  EXPECT_EQ(all.points, 300 * kKinds);
  EXPECT_GT(all.inside, 300) << "points inside, which balls of the interior have to hold";
}

// The test above finds radii that are wrong by a fifth of the stand-out.
TEST(Cover, DamagedCoversAreFound) {
  Random random(45);
  const Body body = any_body(random, 0);
  Cover cover = *make_cover(body.parts);
  Cover small = cover, large = cover;
  for (CoverBall& ball : small.balls) ball.outer -= 0.2f * (ball.outer - std::max(ball.inner, 0.0f));
  for (CoverBall& ball : large.balls) ball.inner += 0.2f * (ball.outer - std::max(ball.inner, 0.0f));
  EXPECT_GT(try_body(body, small, 300, random).wrong_lower, 0);
  EXPECT_GT(try_body(body, large, 300, random).wrong_upper, 0);
}

TEST(Cover, IsATreeWhoseLevelsGetNarrower) {
  Random random(46);
  for (int kind = 0; kind < kKinds; ++kind) {
    const Body body = any_body(random, kind);
    SCOPED_TRACE(body.kind);
    const Cover cover = *make_cover(body.parts);
    ASSERT_EQ(cover.first_child.size(), cover.balls.size() + 1);
    EXPECT_EQ(cover.first_child[0], 1u);
    for (std::uint32_t i = 0; i < cover.balls.size(); ++i) {
      const bool is_last = i >= cover.level_begin[Cover::kLevels - 1];
      EXPECT_EQ(cover.first_child[i] == cover.first_child[i + 1], is_last) << i;
    }
    EXPECT_EQ(cover.first_child.back(), cover.balls.size());
    for (int level = 1; level < Cover::kLevels; ++level)
      EXPECT_LE(stand_out(cover, level).mean, stand_out(cover, level - 1).mean) << level;
    EXPECT_LT(stand_out(cover, 2).mean, 0.12 * reach_of(body));
    const Cover again = *make_cover(body.parts);
    ASSERT_EQ(again.balls.size(), cover.balls.size());
    EXPECT_EQ(0, std::memcmp(again.balls.data(), cover.balls.data(), cover.balls.size() * sizeof(CoverBall)));
  }
}

TEST(Cover, RoundCoresAreHeldAndHold) {
  using Kind = Primitive::Kind;
  Random random(47);
  for (const Primitive& core : {Primitive{Kind::kCylinder, {0.2, 0.2, 0.5}}, Primitive{Kind::kCone, {0.3, 0.3, 0.2}},
                                Primitive{Kind::kEllipsoid, {0.5, 0.1, 0.3}}}) {
    SCOPED_TRACE(name_of(core.kind));
    const ConvexPartPtr part = make_primitive_part(core, 0.01);
    const Cover cover = *make_cover(std::span(&part, 1));
    const Vec3d& s = core.size;
    for (int i = 0; i < 2000; ++i) {
      // A point of the surface of the core, grown by the radius along an outward direction.
      const Vec3d n{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
      const FarthestPoint<double> far = farthest(core, n);
      const Vec3d p = far.point + n * (0.01 / norm(n));
      bool is_held[Cover::kLevels] = {};
      for (int level = 0; level < Cover::kLevels; ++level)
        for (const CoverBall& b : cover.level(level)) {
          const double d = norm(p - Vec3d{b.centre[0], b.centre[1], b.centre[2]});
          is_held[level] = is_held[level] || d <= b.outer + 1e-12 * s.x;
          EXPECT_GE(d, b.inner - 1e-12 * s.x) << "a point of the surface is in no ball that the body holds";
        }
      for (const bool held : is_held) EXPECT_TRUE(held);
    }
  }
}

TEST(Cover, HalfSpacesHaveNone) {
  const ConvexPartPtr part = make_primitive_part({Primitive::Kind::kHalfSpace, {0, 0, 0}});
  EXPECT_FALSE(make_cover(std::span(&part, 1)));
  EXPECT_FALSE(make_cover({}));
}

}  // namespace
}  // namespace clearance
