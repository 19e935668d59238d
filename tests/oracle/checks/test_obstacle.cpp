// Compares the gaps of points from obstacles with exact signed distances, in integers and in 450 bits.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "engine/bvh/surface.h"
#include "engine/cover/point_gaps.h"
#include "engine/hull/hull.h"
#include "engine/hull/primitive.h"
#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/exact/exact_distance.h"
#include "tests/oracle/exact/exact_round.h"

namespace clearance::exact {
namespace {

using Kind = Obstacle::Kind;

constexpr int kCases = 300;  // of each kind, with eight points each

/// Eight points.
struct Points {
  float x[8], y[8], z[8];
};

[[gnu::noinline]] void gaps_of(const Obstacle& o, const Points& p, PointGaps& gaps) {
  point_gaps(o, p.x, p.y, p.z, gaps);
}
#if defined(__x86_64__) && defined(__GNUC__)
[[gnu::noinline, gnu::target("avx2")]] void gaps_of_avx2(const Obstacle& o, const Points& p, PointGaps& gaps) {
  point_gaps(o, p.x, p.y, p.z, gaps);
}
[[gnu::noinline, gnu::target("avx512f")]] void gaps_of_avx512(const Obstacle& o, const Points& p, PointGaps& gaps) {
  point_gaps(o, p.x, p.y, p.z, gaps);
}
#endif

/// Signed distance of a point from a part.
Real exact_gap(const ConvexPart& part, const Pose& X, const Vec3d& p) {
  if (part.primitive)
    return from_round(*part.primitive, turned(X, difference(real(p), real(X.translation)), true)) - real(part.radius);
  const Value value = exact_distance({part.vertices, part.radius}, X, {std::span(&p, 1), 0}, Pose{}).distance;
  const Real core = sqrt(Real(mpq_class(value.numerator, value.denominator), kBits));
  return Real(value.sign * core) - Real(value.radius, kBits);
}

/// How a part is placed.
enum class Turn { kNone, kQuarter, kAny };

Pose any_pose(Random& random, Turn turn, double away) {
  const Vec3d t = random.direction() * away;
  if (turn == Turn::kAny) return random.rotation(t);
  if (turn == Turn::kNone) return Pose{t};
  // The 24 rotations of a cube, up to repetitions.
  static const double half = std::sqrt(0.5);
  Pose X{t, half, 0, 0, 0};
  (&X.qx)[random.integer(0, 2)] = random.sign() * half;
  if (random.chance(0.5)) X = compose(X, Pose{{0, 0, 0}, 0.5, 0.5, 0.5, 0.5});
  return X;
}

ConvexPartPtr hull(const std::vector<Vec3d>& vertices, double radius) {
  return make_hull_part(vertices, {}, radius);
}

/// A part of about some size, in metres.
ConvexPartPtr any_part(Random& random, const std::string& kind, double size) {
  const auto one = [&] { return size * random.uniform(0.2, 1); };
  const double radius = random.chance(0.5) ? 0 : one() * 0.3;
  const Vec3d by = random.direction() * (random.chance(0.5) ? 0 : 2 * size);
  const auto moved = [&](std::vector<Vec3d> vertices) {
    for (Vec3d& v : vertices) v = v + by;
    return vertices;
  };
  if (kind == "sphere") return hull({by}, one());
  if (kind == "capsule") {
    Vec3d along = random.direction() * one();
    if (random.chance(0.5)) along = Vec3d{0, 0, one()};
    return hull(moved({along, -along}), one());
  }
  if (kind == "box") return hull(moved(box({one(), one(), one()})), radius);
  if (kind == "rectangle") return hull(moved(box({one(), 0, one()})), radius);
  if (kind == "cylinder") return make_primitive_part({Primitive::Kind::kCylinder, {size, size, one()}}, radius);
  if (kind == "cone") return make_primitive_part({Primitive::Kind::kCone, {size, size, one()}}, radius);
  if (kind == "ellipsoid") return make_primitive_part({Primitive::Kind::kEllipsoid, {one(), one(), one()}}, radius);
  if (kind == "half_space") return make_primitive_part({Primitive::Kind::kHalfSpace, {0, 0, 0}}, radius);
  std::vector<Vec3d> vertices;
  for (int i = kind == "hull" ? random.integer(4, 20) : kind == "flat" ? 8 : 100; i > 0; --i)
    vertices.push_back(random.direction() * size);
  if (kind == "flat")
    for (Vec3d& v : vertices) v.z = v.x;
  return hull(moved(vertices), radius);
}

/// A point of the core's surface: of a face, an edge, a corner.
Vec3d surface_point(Random& random, const ConvexPart& part, Vec3d n, double size) {
  if (is_half_space(part)) return {random.uniform(-size, size), random.uniform(-size, size), 0};
  if (part.primitive) {
    if (random.chance(0.3)) n = Vec3d{0, 0, n.z} + n * 1e-4;
    if (random.chance(0.3)) n.z = 0;
    return farthest(*part.primitive, n).point * (random.chance(0.3) ? random.uniform() : 1);
  }
  Vec3d p{0, 0, 0};
  const int corners = random.integer(1, 4);
  if (random.chance(0.5)) n[random.integer(0, 2)] *= 100;  // the corners of a face of a box
  std::vector<Vec3d> high = part.vertices;
  std::sort(high.begin(), high.end(), [&](const Vec3d& a, const Vec3d& b) { return dot(n, a) > dot(n, b); });
  high.resize(std::min<std::size_t>(high.size(), 4));
  for (int k = 0; k < corners; ++k) p += high[random.integer(0, static_cast<int>(high.size()) - 1)] * (1.0 / corners);
  return p;
}

/// A point near the part, no farther from the frame's origin than `reach`.
Vec3<float> any_point(Random& random, const ConvexPart& part, const Pose& X, double size, double reach) {
  const Vec3d n = random.direction();
  Vec3d p = surface_point(random, part, n, size);
  if (random.chance(0.2)) p = random.direction() * (random.uniform() * size) + part.centre;
  if (random.chance(0.7)) p += n * (random.sign() * random.log_uniform(1e-9, 5) * size + part.radius);
  p = rotation_of(X) * p + X.translation;
  if (random.chance(0.1)) p = random.direction() * reach;
  const double far = norm(p);
  if (far > reach * 0.9999999) p = p * (0.9999999 * reach / far);
  return cast<float>(p);
}

/// Numbers of points, and of obstacles that are far away or aligned.
struct Found {
  int points = 0, inside = 0, near = 0, far = 0, aligned = 0;
  int decidable = 0, undecided = 0;  ///< ten times the error apart or deep, and proved to be neither
  double worst = 0;                  ///< greatest deviation of an exact kind, as a share of the error
};

void check_point(const Real& exact, double low, double high, double error, bool is_exact, Found& found) {
  ASSERT_TRUE(std::isfinite(low) && std::isfinite(high));
  const Real apart = exact > 0 ? exact : real(0);
  ASSERT_LE(real(low) - real(error), apart) << low - exact.get_d() << " of " << error;
  ASSERT_GE(real(high) + real(error), exact) << high - exact.get_d() << " of " << error;
  if (is_exact) {
    const double off = std::max(std::abs(Real(real(low) - exact).get_d()), std::abs(Real(real(high) - exact).get_d()));
    ASSERT_LE(off, error);
    found.worst = std::max(found.worst, off / error);
  }
  ++found.points;
  found.inside += exact < 0;
  found.near += abs(exact) < 1e-5;
  found.decidable += abs(exact) > 10 * error;
  found.undecided += abs(exact) > 10 * error && !(high + error < 0 || low - error > 0);
}

void check_bits(const Obstacle& o, const Points& p, const PointGaps& gaps) {
#if defined(__x86_64__) && defined(__GNUC__)
  PointGaps other;
  if (__builtin_cpu_supports("avx2")) {
    gaps_of_avx2(o, p, other);
    ASSERT_EQ(0, std::memcmp(&other, &gaps, sizeof gaps));
  }
  if (__builtin_cpu_supports("avx512f")) {
    gaps_of_avx512(o, p, other);
    ASSERT_EQ(0, std::memcmp(&other, &gaps, sizeof gaps));
  }
#endif
}

/// The planes hold the part's vertices.
void check_planes(const Obstacle& o, const ConvexPart& part, const Pose& X) {
  for (std::size_t i = 0; i < o.outer.size(); ++i) {
    const Vec3r n = real(Vec3d{o.normal_x[i], o.normal_y[i], o.normal_z[i]}), in_body = turned(X, n, true);
    ASSERT_LE(product(n, n), 1);
    const Real at = product(n, real(X.translation));
    for (const Vec3d& v : part.vertices) ASSERT_LE(Real(product(in_body, real(v)) + at), real(o.outer[i]));
  }
}

void check_case(Random& random, const std::string& kind, int i, Found& found) {
  const double size = random.chance(0.2) ? 100 : random.log_uniform(1e-3, 3);
  const double reach = random.chance(0.2) ? random.log_uniform(1, 1e4) : random.uniform(0.5, 3);
  const Turn turn = static_cast<Turn>(i % 3);
  const ConvexPartPtr part = any_part(random, kind, size);
  const double away = random.chance(0.2) ? 1000 : random.chance(0.5) ? 0.7 * reach : random.uniform() * (reach + size);
  const Pose X = any_pose(random, turn, away);
  const std::optional<Obstacle> o = make_obstacle(*part, rotation_of(X), X.translation, reach);
  ASSERT_TRUE(o);
  ASSERT_LT(o->error, 3e-6 * (reach + away + 10 * size));
  found.aligned += o->is_aligned;
  found.far += away >= 1000;
  ASSERT_NO_FATAL_FAILURE(check_planes(*o, *part, X));
  Points p;
  for (int k = 0; k < 8; ++k) {
    const Vec3<float> c = any_point(random, *part, X, size, reach);
    p.x[k] = c.x, p.y[k] = c.y, p.z[k] = c.z;
  }
  PointGaps gaps;
  gaps_of(*o, p, gaps);
  check_bits(*o, p, gaps);
  for (int k = 0; k < 8; ++k) {
    const Real exact = exact_gap(*part, X, {p.x[k], p.y[k], p.z[k]});
    ASSERT_NO_FATAL_FAILURE(check_point(exact, gaps.low[k], gaps.high[k], o->error, o->kind != Kind::kPlanes, found))
        << kind << ' ' << i << ", point " << k;
  }
}

Found check_kind(const std::string& kind) {
  mpf_set_default_prec(kBits);
  Random random(44);
  Found found;
  for (int i = 0; i < kCases && !testing::Test::HasFatalFailure(); ++i) check_case(random, kind, i, found);
  std::printf("%s: %d points, %d inside, %d near, %d far, %d aligned, %d of %d undecided, worst %.2f\n", kind.c_str(),
              found.points, found.inside, found.near, found.far, found.aligned, found.undecided, found.decidable,
              found.worst);
  EXPECT_EQ(found.points, 8 * kCases);
  EXPECT_GT(found.inside, kCases);
  EXPECT_GT(found.near, 100);
  EXPECT_GT(found.far, 20);
  return found;
}

struct ObstacleKind {
  const char* name;
  int aligned;             ///< obstacles, at least
  double least_deviation;  ///< as a share of the error; 0 for polytopes
  double undecided;        ///< share of points, at most
};

class ObstacleKinds : public testing::TestWithParam<ObstacleKind> {};

TEST_P(ObstacleKinds, GapsHoldTheExactDistance) {
  const Found found = check_kind(GetParam().name);
  EXPECT_GE(found.aligned, GetParam().aligned);
  EXPECT_GE(found.worst, GetParam().least_deviation);
  EXPECT_LE(found.undecided, GetParam().undecided * found.decidable);
}

INSTANTIATE_TEST_SUITE_P(All, ObstacleKinds,
                         testing::Values(ObstacleKind{"sphere", kCases, 0.15, 0},
                                         ObstacleKind{"capsule", kCases / 4, 0.15, 0},
                                         ObstacleKind{"box", 2 * kCases / 3, 0.15, 0},
                                         ObstacleKind{"rectangle", 2 * kCases / 3, 0.15, 0},
                                         ObstacleKind{"cylinder", kCases / 3, 0.15, 0},
                                         ObstacleKind{"half_space", 0, 0.15, 0}, ObstacleKind{"hull", 0, 0, 0.1},
                                         ObstacleKind{"large_hull", 0, 0, 0.15}, ObstacleKind{"flat", 0, 0, 0.3},
                                         ObstacleKind{"cone", 0, 0, 0.2}, ObstacleKind{"ellipsoid", 0, 0, 0.15}),
                         [](const auto& kind) { return std::string(kind.param.name); });

TEST(Obstacle, OfUnusableNumbersThereIsNone) {
  const ConvexPartPtr part = hull(box({1, 2, 3}), 0.1);
  const Mat3d R = Mat3d::identity();
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(make_obstacle(*part, R, {0, 0, 0}, 1e4));
  EXPECT_TRUE(make_obstacle(*part, R, {9e5, 0, 0}, 1e4));
  for (const double reach : {1.01e4, inf, nan, -1.0}) EXPECT_FALSE(make_obstacle(*part, R, {0, 0, 0}, reach));
  for (const double x : {1.01e6, inf, -inf, nan}) {
    EXPECT_FALSE(make_obstacle(*part, R, {0, x, 0}, 1));
    EXPECT_FALSE(make_obstacle(*make_primitive_part({Primitive::Kind::kHalfSpace, {0, 0, 0}}), R, {0, 0, x}, 1));
  }
  Mat3d broken = R;
  broken.row[1].z = nan;
  EXPECT_FALSE(make_obstacle(*part, broken, {0, 0, 0}, 1));
  EXPECT_FALSE(make_obstacle(*hull(box({1e6, 1, 1}), 0), R, {0, 0, 0}, 1));
  ConvexPart mesh = *part;
  mesh.surface = std::make_shared<const Surface>(std::vector<Vec3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
                                                 std::vector<Triangle>{{0, 1, 2}}, false);
  EXPECT_FALSE(make_obstacle(mesh, R, {0, 0, 0}, 1));
}

}  // namespace
}  // namespace clearance::exact
