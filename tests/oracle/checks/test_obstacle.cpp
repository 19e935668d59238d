// Compares the gaps of points from obstacles with exact signed distances, in integers and in 450 bits.
#include <gmpxx.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "engine/cover/point_gaps.h"
#include "engine/hull/hull.h"
#include "engine/hull/primitive.h"
#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/exact/exact_difference.h"

namespace clearance::exact {
namespace {

constexpr unsigned kBits = 450;
using Real = mpf_class;
using Kind = Obstacle::Kind;

Real real(double x) {
  return Real(x, kBits);
}
Real real(const mpq_class& x) {
  return Real(x, kBits);
}

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

/// The point in the body's axes, exactly.
Vec3<mpq_class> in_body(const Pose& X, const Vec3d& p) {
  const mpq_class w(X.qw), x(X.qx), y(X.qy), z(X.qz), n = w * w + x * x + y * y + z * z;
  const mpq_class d[3] = {mpq_class(p.x) - mpq_class(X.translation.x), mpq_class(p.y) - mpq_class(X.translation.y),
                          mpq_class(p.z) - mpq_class(X.translation.z)};
  const mpq_class m[3][3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                             {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                             {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
  const auto column = [&](int k) { return mpq_class((m[0][k] * d[0] + m[1][k] * d[1] + m[2][k] * d[2]) / n); };
  return {column(0), column(1), column(2)};
}

/// Signed distance of a point from a cylinder or half-space.
Real from_primitive(const Primitive& core, const Vec3<mpq_class>& p) {
  if (core.kind == Primitive::Kind::kHalfSpace) return real(p.z);
  const Real side = sqrt(real(mpq_class(p.x * p.x + p.y * p.y))) - real(core.size.x),
             end = abs(real(p.z)) - real(core.size.z);
  if (side <= 0 || end <= 0) return side < end ? end : side;
  return sqrt(Real(side * side + end * end));
}

Real exact_gap(const ConvexPart& part, const Pose& X, const Vec3d& p) {
  if (part.primitive) return from_primitive(*part.primitive, in_body(X, p)) - real(part.radius);
  const Value value = exact_distance({part.vertices, part.radius}, X, {std::span(&p, 1), 0}, Pose{}).distance;
  const Real core = sqrt(real(mpq_class(value.numerator, value.denominator)));
  return Real(value.sign * core) - real(value.radius);
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

/// A number of cases of each of which the tests assert some.
struct Found {
  int points = 0, inside = 0, near = 0, far = 0, aligned = 0, proved_inside = 0, proved_apart = 0;
  double worst = 0;  ///< greatest deviation of an exact kind, as a part of the error
};

void check_point(const Real& exact, double low, double high, double error, bool is_exact, Found& found) {
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
  found.proved_inside += high + error < 0;
  found.proved_apart += low - error > 0;
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

/// The planes hold the part's vertices, exactly.
void check_planes(const Obstacle& o, const ConvexPart& part, const Pose& X) {
  for (std::size_t i = 0; i < o.outer.size(); ++i) {
    const Vec3d n{o.normal_x[i], o.normal_y[i], o.normal_z[i]};
    const mpq_class x(n.x), y(n.y), z(n.z);
    ASSERT_LE(mpq_class(x * x + y * y + z * z), 1);
    // n in the body's axes: `in_body` of a pose without translation.
    const Vec3<mpq_class> m = in_body({{0, 0, 0}, X.qw, X.qx, X.qy, X.qz}, n);
    const mpq_class at =
        x * mpq_class(X.translation.x) + y * mpq_class(X.translation.y) + z * mpq_class(X.translation.z);
    for (const Vec3d& v : part.vertices)
      ASSERT_LE(mpq_class(m.x * mpq_class(v.x) + m.y * mpq_class(v.y) + m.z * mpq_class(v.z) + at),
                mpq_class(double{o.outer[i]}));
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

Found check_kind(const std::string& kind, int cases) {
  Random random(44);
  Found found;
  for (int i = 0; i < cases && !testing::Test::HasFatalFailure(); ++i) check_case(random, kind, i, found);
  std::printf("%s: %d points, %d inside, %d near, %d far, %d aligned, %d and %d proved, worst %.2f\n", kind.c_str(),
              found.points, found.inside, found.near, found.far, found.aligned, found.proved_inside, found.proved_apart,
              found.worst);
  return found;
}

TEST(Obstacle, BoundsOfPointsHoldTheExactDistance) {
  for (const char* kind :
       {"sphere", "capsule", "box", "rectangle", "cylinder", "half_space", "hull", "large_hull", "flat"}) {
    const Found found = check_kind(kind, 300);
    if (HasFatalFailure()) return;
    EXPECT_EQ(found.points, 2400);
  }
}

}  // namespace
}  // namespace clearance::exact
