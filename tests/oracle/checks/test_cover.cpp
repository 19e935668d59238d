// Compares covers with exact geometry: points of a body lie in balls on every level, and inner radii hold.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

#include "engine/cover/cover.h"
#include "engine/geometry/cloud_geometry.h"
#include "engine/hull/hull.h"
#include "engine/hull/primitive.h"
#include "engine/scene/scene.h"
#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/decision/cover_points.h"
#include "tests/oracle/exact/exact_distance.h"
#include "wire/types.h"

namespace clearance {
namespace {

using exact::Random;

constexpr double kEffort = 0.1;  // wider balls, made with the same proofs

/// A body as its cover sees it, and as the oracle does: unions of hulls, grown.
struct Body {
  std::string kind;
  std::vector<exact::SolidPtr> solids;

  std::vector<ConvexPartPtr> parts() const {
    std::vector<ConvexPartPtr> parts;
    for (const auto& s : solids) parts.push_back(make_hull_part(s->vertices, {}, s->radius));
    return parts;
  }
  /// The same body, scaled along each axis; a radius by the first of them.
  Body scaled(const std::string& name, const Vec3d& by) const {
    Body body{kind + ", " + name, {}};
    for (const auto& s : solids)
      body.solids.push_back(exact::solid(exact::scaled(s->vertices, by), s->radius * std::abs(by.x)));
    return body;
  }
};

exact::SolidPtr moved(const exact::SolidPtr& solid, const Vec3d& by) {
  std::vector<Vec3d> vertices = solid->vertices;
  for (Vec3d& v : vertices) v += by;
  return exact::solid(std::move(vertices), solid->radius);
}

/// An ellipsoid of many vertices among so many points that its cover sees only a few of them.
Body egg(Random& random) {
  std::vector<Vec3d> vertices;
  for (int i = 0; i < 1000; ++i) vertices.push_back(random.direction());
  Body body{"egg", {exact::solid(exact::scaled(vertices, {0.3, 0.2, 0.5}))}};
  body.solids.resize(50, exact::solid({{0.01, 0, 0}}));
  return body;
}

std::vector<Body> bodies() {
  Random random(44);
  const exact::SolidPtr hull = exact::solid(exact::ordinary(random));
  const Body several{"union", {hull, moved(exact::faced(random), {0.7, 0.2, -0.1}), exact::solid({{-0.9, 0, 0}}, 0.3)}};
  std::vector<Body> all{{"box", {exact::solid(exact::box({0.1, 0.2, 0.3}))}},
                        {"hull", {hull}},
                        several,
                        {"needle", {exact::needle(random)}},
                        {"plate", {exact::plate(random)}},
                        {"flat", {exact::flat(random)}},
                        {"line", {exact::line(random)}},
                        {"sliver", {exact::sliver(random)}},
                        {"point", {exact::solid({{0.1, -0.2, 0.3}})}},
                        {"sphere", {exact::solid({{0.1, -0.2, 0.3}}, 0.25)}},
                        {"capsule", {exact::solid({{0, 0, -0.4}, {0, 0, 0.4}}, 0.1)}},
                        {"rounded hull", {exact::solid(exact::ordinary(random), 0.05)}},
                        {"rounded flat", {exact::solid(exact::flat(random)->vertices, 0.05)}},
                        egg(random),
                        several.scaled("tiny", {1e-6, 1e-6, 1e-6}),
                        several.scaled("mirrored, huge", {-1e4, 1e4, 1e4})};
  const engine::Scene cell = engine::Scene::load(std::string(CLEARANCE_SOURCE_DIR) + "/scenes/cell/robot.yaml");
  all.push_back({"link", {}});
  for (const ConvexPartPtr& part : cell.bodies().at(cell.find_body("arm/upper_arm")).parts)
    all.back().solids.push_back(exact::solid(part->vertices));
  return all;
}

/// A point of a body, exactly: a vertex, or a combination of a few, grown by the radius.
Vec3q point_of(Random& random, const Body& body) {
  const exact::Solid& s =
      *body.solids[static_cast<std::size_t>(random.integer(0, static_cast<int>(body.solids.size()) - 1))];
  Vec3q p{0, 0, 0};
  mpq_class sum = 0;
  for (int i = random.integer(1, 5); i > 0; --i) {
    const mpq_class weight = random.integer(1, 9);
    const auto any = static_cast<std::size_t>(random.integer(0, static_cast<int>(s.vertices.size()) - 1));
    p = p + times(rational(s.vertices[any]), weight);
    sum += weight;
  }
  p = times(p, 1 / sum);
  return p + times(unit(random), mpq_class(s.radius) * mpq_class(random.integer(0, 3), 3));
}

TEST(Cover, HoldsPointsOnEveryLevel) {
  Random random(45);
  for (const Body& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const std::optional<Cover> cover = make_cover(body.parts(), nullptr, kEffort);
    ASSERT_TRUE(cover);
    for (const auto& s : body.solids)
      for (const Vec3d& v : s->vertices) ASSERT_TRUE(has_path(*cover, rational(v))) << v.x << " " << v.y << " " << v.z;
    for (int i = 0; i < 250; ++i) {
      const Vec3q p = point_of(random, body);
      ASSERT_TRUE(has_path(*cover, p)) << p.x.get_d() << " " << p.y.get_d() << " " << p.z.get_d();
      EXPECT_LE(squared(p), mpq_class(cover->reach) * mpq_class(cover->reach));
    }
  }
}

TEST(Cover, InnerRadiiHold) {
  Random random(46);
  int in_body = 0, near_body = 0;
  for (const Body& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const std::vector<CoverBall> balls = all_balls(*make_cover(body.parts(), nullptr, kEffort));
    for (std::size_t i = 0; i < balls.size(); i += 1 + balls.size() / 40) {
      const Vec3d c{balls[i].centre[0], balls[i].centre[1], balls[i].centre[2]};
      // A ball that a part holds is as deep in it; a point of a part is as near.
      bool is_proved = false;
      for (const auto& s : body.solids) {
        if (is_proved) break;
        const exact::Result exact =
            exact::exact_distance({s->vertices, s->radius}, Pose{}, {std::span(&c, 1), 0}, Pose{});
        is_proved = exact.distance.compare(-double{balls[i].inner}) <= 0;
      }
      ASSERT_TRUE(is_proved) << i << ": inner radius " << balls[i].inner;
      ++(balls[i].inner > 0 ? in_body : near_body);
    }
  }
  EXPECT_GT(in_body, 100);
  EXPECT_GT(near_body, 100);
}

/// A point of the surface of a round core, exactly.
Vec3q surface_point(const Primitive& core, Random& random) {
  const Vec3q n = unit(random), size = rational(core.size);
  if (core.kind == Primitive::Kind::kEllipsoid) return {n.x * size.x, n.y * size.y, n.z * size.z};
  const mpq_class t(random.integer(-40, 40), 10), z = size.z * mpq_class(random.integer(-8, 8), 8);
  mpq_class across = size.x;
  if (core.kind == Primitive::Kind::kCone) across *= (size.z - z) / (2 * size.z);
  if (random.chance(0.3)) return {across * mpq_class(random.integer(0, 4), 4), 0, -size.z};  // of the disc
  return {across * (1 - t * t) / (1 + t * t), across * 2 * t / (1 + t * t), z};
}

TEST(Cover, RoundCoresAreHeldAndHold) {
  using Kind = Primitive::Kind;
  Random random(47);
  int in_body = 0;
  for (const Primitive& core :
       {Primitive{Kind::kCylinder, {0.2, 0.2, 0.5}}, Primitive{Kind::kCylinder, {0.5, 0.5, 0.1}},
        Primitive{Kind::kCone, {0.3, 0.3, 0.2}}, Primitive{Kind::kCone, {0.1, 0.1, 0.4}},
        Primitive{Kind::kEllipsoid, {0.5, 0.1, 0.3}}}) {
    SCOPED_TRACE(name_of(core.kind));
    const double radius = random.chance(0.5) ? 0.01 : 0;
    const ConvexPartPtr part = make_primitive_part(core, radius);
    const Cover cover = *make_cover(std::span(&part, 1), nullptr, kEffort);
    const std::vector<CoverBall> balls = all_balls(cover);
    for (int i = 0; i < 150; ++i) {
      const Vec3q p = surface_point(core, random);
      ASSERT_TRUE(has_path(cover, p + times(unit(random), mpq_class(radius))));
      ASSERT_TRUE(has_path(cover, times(p, mpq_class(random.integer(0, 9), 10))));
      for (const CoverBall& ball : balls) {
        const mpq_class depth = mpq_class(ball.inner) - mpq_class(radius);
        if (depth <= 0) continue;
        ++in_body;
        ASSERT_GE(squared(p - rational({ball.centre[0], ball.centre[1], ball.centre[2]})), depth * depth)
            << "a point of the core's surface is in no ball that the core holds";
      }
    }
  }
  EXPECT_GT(in_body, 1000);
}

TEST(Cover, IsATree) {
  for (const Body& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const Cover cover = *make_cover(body.parts(), nullptr, kEffort);
    EXPECT_EQ(cover.level_begin[1], 0u);
    EXPECT_GE(cover.level_begin[2], 1u);
    EXPECT_LE(cover.level_begin[2], 2u);
    EXPECT_EQ(cover.level_begin[Cover::kLevels], cover.packets.size());
    std::vector<int> parents(cover.packets.size(), 0);
    for (int level = 1; level < Cover::kLevels; ++level)
      for (const BallPacket& packet : cover.level(level)) {
        ASSERT_GE(packet.count, 1u);
        for (std::uint32_t i = 0; i < BallPacket::kBalls; ++i) {
          EXPECT_EQ(packet.outer[i] == BallPacket::kNoRadius, i >= packet.count);
          EXPECT_EQ(packet.inner[i] == BallPacket::kNoRadius, i >= packet.count);
          if (packet.children[i] == kNone) continue;
          ASSERT_LT(i, packet.count);
          ASSERT_LT(level, Cover::kLevels - 1);
          ASSERT_GE(packet.children[i], cover.level_begin[level + 1]);
          ASSERT_LT(packet.children[i], cover.level_begin[level + 2]);
          ++parents[packet.children[i]];
        }
      }
    for (std::size_t i = cover.level_begin[2]; i < parents.size(); ++i) EXPECT_EQ(parents[i], 1);
    for (const CoverBall& ball : all_balls(cover))
      EXPECT_LE(squared(rational({ball.centre[0], ball.centre[1], ball.centre[2]})),
                mpq_class(cover.reach) * mpq_class(cover.reach));
  }
}

TEST(Cover, LevelsGetNarrower) {
  const Body body{"box", {exact::solid(exact::box({0.1, 0.2, 0.3}))}};
  const Cover cover = *make_cover(body.parts(), nullptr, 0.3), again = *make_cover(body.parts(), nullptr, 0.3);
  ASSERT_EQ(cover.packets.size(), again.packets.size());
  EXPECT_EQ(std::memcmp(cover.packets.data(), again.packets.data(), cover.packets.size() * sizeof(BallPacket)), 0);
  for (int level = 1; level < Cover::kLevels; ++level) {
    EXPECT_LT(stand_out(cover, level).mean, 0.7 * stand_out(cover, level - 1).mean) << level;
    EXPECT_LT(stand_out(cover, level).greatest, 3 * stand_out(cover, level).mean + 0.03) << level;
  }
  EXPECT_LT(stand_out(cover, 3).mean, 0.014);
  EXPECT_GT(stand_out(cover, 3).balls, 600u);
}

TEST(Cover, ASphereIsOneBall) {
  const Body body{"sphere", {exact::solid({{0.1, -0.2, 0.3}}, 0.25)}};
  const Cover cover = *make_cover(body.parts());
  ASSERT_EQ(cover.packets.size(), 1u);
  EXPECT_EQ(cover.packets[0].count, 1u);
  EXPECT_EQ(cover.packets[0].children[0], kNone);
  EXPECT_LT(stand_out(cover, 1).greatest, 1e-6);
}

TEST(Cover, SomeBodiesHaveNone) {
  const ConvexPartPtr half_space = make_primitive_part({Primitive::Kind::kHalfSpace, {0, 0, 0}});
  EXPECT_FALSE(make_cover(std::span(&half_space, 1)));
  EXPECT_FALSE(make_cover({}));
  const std::vector<Vec3d> far{{2e9, 0, 0}}, origin{{0, 0, 0}};
  const ConvexPartPtr beyond = make_hull_part(far, {}, 0), point = make_hull_part(origin, {}, 0);
  EXPECT_FALSE(make_cover(std::span(&beyond, 1)));
  const ConvexPartPtr cloud = make_cloud_part(std::vector<CloudPoint>((1u << 17) + 1), 0, 0);
  EXPECT_FALSE(make_cover(std::span(&cloud, 1)));
  EXPECT_TRUE(make_cover(std::vector<ConvexPartPtr>(300, point)));
  EXPECT_FALSE(make_cover(std::vector<ConvexPartPtr>(301, point)));
}

}  // namespace
}  // namespace clearance
