// Compares half-spaces with exact results: the distance of a convex part from a plane is a rational number, so nothing
// is rounded here.
#include <gmpxx.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "engine/hull/box.h"
#include "engine/narrow/narrow_phase.h"
#include "tests/engine/evaluate_query.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

using Vec3q = Vec3<mpq_class>;

Vec3q rational(const Vec3d& v) {
  return {mpq_class(v.x), mpq_class(v.y), mpq_class(v.z)};
}
mpq_class product(const Vec3q& a, const Vec3q& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

// M(q) v / |q|^2.
Vec3q turned(const Pose& X, const Vec3q& v) {
  const mpq_class w(X.qw), x(X.qx), y(X.qy), z(X.qz), n = w * w + x * x + y * y + z * z;
  const Vec3q rows[3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                         {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                         {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
  return {product(rows[0], v) / n, product(rows[1], v) / n, product(rows[2], v) / n};
}

// The exact signed distance of a part from the grown half-space.
mpq_class height(const ConvexPart& plane, const Pose& X_plane, const ConvexPart& part, const Pose& X_part) {
  const Vec3q n = turned(X_plane, {0, 0, 1}), t_a = rational(X_plane.translation), t_b = rational(X_part.translation);
  mpq_class least;
  bool first = true;
  for (const Vec3d& v : part.vertices) {
    const Vec3q p = turned(X_part, rational(v));
    const mpq_class at = product(n, {p.x + t_b.x - t_a.x, p.y + t_b.y - t_a.y, p.z + t_b.z - t_a.z});
    if (first || at < least) least = at;
    first = false;
  }
  return least - mpq_class(plane.radius) - mpq_class(part.radius);
}

// A plane along the world's axes, with a quaternion of any length, or nearly so, or in any orientation.
Pose plane_pose(Random& random, const Vec3d& at) {
  constexpr double kAlong[6][4] = {{1, 0, 0, 0},  {0, 1, 0, 0}, {1, 1, 0, 0},
                                   {1, -1, 0, 0}, {1, 0, 1, 0}, {1, 0, -1, 0}};
  if (random.chance(0.4)) {
    const auto& q = kAlong[random.integer(0, 5)];
    const double length = random.chance(0.5) ? 1 : random.log_uniform(1e-4, 1e4);
    Pose X{at, q[0] * length, q[1] * length, q[2] * length, q[3] * length};
    if (random.chance(0.3)) X.qx += length * random.sign() * random.log_uniform(1e-300, 1e-3);
    return X;
  }
  return random.rotation(at);
}

ConvexPartPtr any_part(Random& random) {
  const double size = random.log_uniform(1e-3, 10);
  std::vector<Vec3d> vertices;
  const int count = random.chance(0.2) ? random.integer(1, 3) : random.chance(0.2) ? 200 : random.integer(4, 40);
  for (int i = 0; i < count; ++i) vertices.push_back(random.direction() * (size * random.uniform(0.2, 1)));
  if (random.chance(0.3))  // an edge or a face parallel to the plane
    for (Vec3d& v : vertices) v.z = v.z > 0 ? size : -size;
  return make_convex_part(std::move(vertices), random.chance(0.4) ? random.log_uniform(1e-4, 1) : 0);
}

struct PlaneCase {
  ConvexPartPtr plane, part;
  Pose X_plane, X_part;
};

// A part over a plane, at a chosen distance: far, near, touching, or deep.
PlaneCase any_case(Random& random, double& wanted) {
  PlaneCase c;
  const double far = random.chance(0.3) ? 1e4 : 3;
  c.X_plane = plane_pose(random, {random.uniform(-far, far), random.uniform(-far, far), random.uniform(-far, far)});
  c.plane = make_primitive_part({Primitive::Kind::kHalfSpace, {0, 0, 0}},
                                random.chance(0.3) ? random.log_uniform(1e-3, 1) : 0);
  c.part = any_part(random);
  c.X_part = random.rotation({random.uniform(-far, far), random.uniform(-far, far), random.uniform(-far, far)});
  if (random.chance(0.3)) c.X_part = {c.X_part.translation, 1, 0, 0, 0};
  const double choices[] = {random.uniform(0, 10), random.log_uniform(1e-12, 1e-3), 0, -random.log_uniform(1e-12, 10)};
  wanted = choices[random.integer(0, 3)];
  const Vec3d n = rotation_of(c.X_plane) * Vec3d{0, 0, 1};
  const mpq_class is = height(*c.plane, c.X_plane, *c.part, c.X_part);
  c.X_part.translation += n * (wanted - is.get_d());
  return c;
}

PoseMatrix placed(const Pose& X) {
  return {rotation_of(X), X.translation, X};
}

bool holds(const Interval& bounds, const mpq_class& exact) {
  return (bounds.lower == -kInf || mpq_class(bounds.lower) <= exact) &&
         (bounds.upper == kInf || mpq_class(bounds.upper) >= exact);
}

TEST(HalfSpace, HoldsTheExactSignedDistance) {
  Random random(1);
  int near = 0, deep = 0, far_from_origin = 0, along_axes = 0, converged = 0;
  double widest = 0;
  for (int i = 0; i < 2000; ++i) {
    double wanted;
    const PlaneCase c = any_case(random, wanted);
    const PoseMatrix plane = placed(c.X_plane), part = placed(c.X_part);
    const mpq_class exact = height(*c.plane, c.X_plane, *c.part, c.X_part);
    NarrowLimits limits;
    limits.signed_distance = true;
    limits.rel_tol = 1e-9;
    const NarrowAnswer first = narrow_phase(*c.plane, plane, *c.part, part, limits);
    const NarrowAnswer second = narrow_phase(*c.part, part, *c.plane, plane, limits);
    const NarrowAnswer reference = narrow_phase_reference(*c.plane, plane, *c.part, part, limits);
    for (const NarrowAnswer* answer : {&first, &second, &reference}) {
      ASSERT_TRUE(holds(answer->bounds, exact)) << i << ": " << answer->bounds.lower << ' ' << answer->bounds.upper;
      ASSERT_LE(answer->bounds.upper - answer->bounds.lower, 4 * answer->rounding);
    }
    ASSERT_EQ(first.bounds.lower, second.bounds.lower);
    ASSERT_EQ(first.bounds.upper, second.bounds.upper);
    // The witness points have the reported distance, and lie on the plane and on its far side.
    const Vec3d D = c.X_part.translation - c.X_plane.translation, n = first.normal;
    const Vec3d across = first.point_b + D - first.point_a;
    const double scale = norm(D) + c.part->rho + c.part->radius + c.plane->radius;
    EXPECT_NEAR(dot(across, n), exact.get_d(), 1e-13 * scale);
    EXPECT_NEAR(norm(across), std::abs(exact.get_d()), 1e-13 * scale);
    EXPECT_NEAR(dot(first.point_a, n), c.plane->radius, 1e-13 * scale);
    EXPECT_LE(norm(first.normal + second.normal), 1e-15);
    near += std::abs(exact.get_d()) < 1e-6;
    deep += exact < -mpq_class(0.1);
    far_from_origin += norm(c.X_plane.translation) > 1e3;
    along_axes += plane.R_wb.row[0].z == 0 && plane.R_wb.row[1].z == 0;
    converged += first.converged;
    widest = std::max(widest, (first.bounds.upper - first.bounds.lower) / scale);
  }
  EXPECT_GT(near, 500);
  EXPECT_GT(deep, 40);
  EXPECT_GT(far_from_origin, 300);
  EXPECT_GT(along_axes, 100);
  EXPECT_GT(converged, 1800);
  std::printf("%d near, %d deep, %d far, %d along axes, %d settled, widest %.2g of S\n", near, deep, far_from_origin,
              along_axes, converged, widest);
}

// A box leaves free space only outside the half-space.
TEST(HalfSpace, BoxesHoldIt) {
  Random random(2);
  int gaps = 0, without = 0;
  for (int i = 0; i < 1500; ++i) {
    double wanted;
    const PlaneCase c = any_case(random, wanted);
    const mpq_class exact = height(*c.plane, c.X_plane, *c.part, c.X_part);
    const PoseMatrix plane = placed(c.X_plane), part = placed(c.X_part);
    const double gap =
        certify_box_gap(certify_box(*c.plane, plane.R_wb, plane.t_w), certify_box(*c.part, part.R_wb, part.t_w));
    if (gap > 0) {
      ASSERT_LE(mpq_class(gap), exact) << i;
    }
    gaps += gap > 0;
    without += gap == 0 && exact > mpq_class(0.1);
  }
  EXPECT_GT(gaps, 60);
  EXPECT_GT(without, 60);  // tilted planes
}

// A floor, a wall and a tilted plane among bodies of one and of several parts, in queries of all kinds.
engine::Scene room_scene(Random& random, std::vector<Pose>& planes) {
  engine::Scene scene;
  planes = {Pose{{0, 0, -1.5}}, Pose{{-3, 0, 0}, 1, 0, 1, 0}, random.rotation({0, 0, -6})};
  for (std::size_t k = 0; k < planes.size(); ++k)
    scene.add_half_space("plane" + std::to_string(k), {.pose = planes[k], .padding = k == 1 ? 0.125 : 0.0});
  for (int i = 0; i < 60; ++i) {
    Body body;
    body.name = "body" + std::to_string(i);
    body.pose = random.rotation({random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3)});
    for (int p = i % 3 == 0 ? 4 : 1; p > 0; --p) {
      std::vector<Vec3d> vertices;
      for (int v = 0; v < 12; ++v) vertices.push_back(random.direction() * 0.3 + Vec3d{0.5 * p, 0, 0});
      body.parts.push_back(make_convex_part(std::move(vertices), i % 2 ? 0.0625 : 0));
    }
    scene.add_body(std::move(body));
  }
  return scene;
}

mpq_class exact_of(const engine::Scene& scene, const std::vector<Pose>& planes, BodyPair pair) {
  const Body &plane = scene.bodies()[pair.a], &body = scene.bodies()[pair.b];
  mpq_class least;
  for (std::size_t p = 0; p < body.parts.size(); ++p) {
    const mpq_class at = height(*plane.parts[0], planes[pair.a], *body.parts[p], *body.pose);
    if (p == 0 || at < least) least = at;
  }
  return least;
}

TEST(HalfSpace, IsQueriedLikeAnyBody) {
  Random random(3);
  std::vector<Pose> planes;
  const engine::Scene scene = room_scene(random, planes);
  std::vector<BodyPair> pairs;
  for (std::uint32_t plane = 0; plane < 3; ++plane)
    for (std::uint32_t body = 3; body < scene.bodies().size(); ++body) pairs.push_back({plane, body});
  int statuses[8] = {};
  for (const char* broad_phase : {"brute", "tree"})
    for (const char* set : {"auto", "baseline"}) {
      const engine::Engine engine(engine::Scene(scene),
                                  {.backend = "cpu", .instruction_set = set, .broad_phase = broad_phase});
      for (const double max_distance : {kInf, 0.75})
        for (const Precision precision : {Precision::kF64, Precision::kF32}) {
          QueryView query;
          query.pairs = pairs;
          query.all_pairs = false;
          query.max_distance = max_distance;
          query.precision = precision;
          query.fields = kDefaultFields | kFieldFlags | kFieldPair;
          const test::Answer dense = test::evaluate(engine, query);
          ASSERT_EQ(dense.info.rows, pairs.size());
          double least = kInf;
          std::size_t within = 0;
          for (std::size_t i = 0; i < pairs.size(); ++i) {
            const mpq_class exact = exact_of(scene, planes, pairs[i]);
            const auto status = static_cast<Status>(dense.view.status[i]);
            ++statuses[static_cast<int>(status)];
            ASSERT_EQ(status, exact > mpq_class(std::min(max_distance, 1e9)) ? Status::kBeyond
                              : exact > 0                                    ? Status::kOk
                                                                             : Status::kOverlap);
            const mpq_class clipped = exact < 0 ? mpq_class(0) : exact;
            ASSERT_TRUE(holds({dense.view.lower[i], dense.view.upper[i]}, clipped)) << i;
            EXPECT_FALSE(dense.view.flags[i] & kFlagUncertaintyLimited);
            least = std::min(least, dense.view.upper[i]);
            within += status != Status::kBeyond;
          }
          query.reduce = Reduce::kMin;
          const test::Answer min = test::evaluate(engine, query);
          EXPECT_EQ(min.view.upper[0], least);
          query.reduce = Reduce::kWithin;
          EXPECT_EQ(test::evaluate(engine, query).info.rows, within);
          query.reduce = Reduce::kNearest;
          query.pairs = {};
          query.all_pairs = true;
          EXPECT_EQ(test::evaluate(engine, query).info.rows, scene.bodies().size());
        }
    }
  EXPECT_GT(statuses[static_cast<int>(Status::kOk)], 100);
  EXPECT_GT(statuses[static_cast<int>(Status::kBeyond)], 100);
  EXPECT_GT(statuses[static_cast<int>(Status::kOverlap)], 100);
}

TEST(HalfSpace, TwoOfThemAreNotIncludedUnlessNamed) {
  Random random(4);
  std::vector<Pose> planes;
  const engine::Engine engine(room_scene(random, planes), {.backend = "cpu"});
  QueryView all;
  for (const BodyPair pair : engine.pairs(all)) EXPECT_GE(std::max(pair.a, pair.b), 3u);
  const std::vector<BodyPair> named{{0, 1}, {1, 2}};
  QueryView query;
  query.pairs = named;
  query.all_pairs = false;
  query.fields = kDefaultFields;
  const test::Answer answer = test::evaluate(engine, query);
  for (std::size_t i = 0; i < answer.info.rows; ++i) {
    EXPECT_EQ(static_cast<Status>(answer.view.status[i]), Status::kUnconverged);
    EXPECT_LE(answer.view.lower[i], 0);
    EXPECT_EQ(answer.view.upper[i], kInf);
  }
}

}  // namespace
}  // namespace clearance::exact
