// Compares the gaps of points from clouds with exact signed distances, in 450 bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/geometry/cloud_geometry.h"
#include "engine/pose/pose.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/exact/exact_round.h"
#define CLEARANCE_ISA cloud_gaps_test
#include "engine/decision/kernel/cloud_gaps.h"

namespace clearance::exact {
namespace {

using cloud_gaps_test::Eight;
using cloud_gaps_test::GapLimits;

constexpr int kCases = 1000;  // of each kind, with eight points each
constexpr float kNever = -1e30f, kAlways = 1e29f;

struct CloudKind {
  const char* name;
  bool has_edge, has_radius;
};

struct CloudCase {
  std::vector<CloudPoint> points;
  float edge;
  double radius, size;
  ConvexPartPtr part;
  Pose X;
  double reach, away;
  std::optional<Obstacle> obstacle;
};

Vec3d exact_place(const CloudPoint& p) {
  return {p[0], p[1], p[2]};
}

/// Points of about some size: scattered, of a plane, or of a grid, some of them twice.
std::vector<CloudPoint> any_points(Random& random, double size) {
  const int count = random.chance(0.2) ? random.integer(1, 4) : random.integer(5, 150), form = random.integer(0, 2);
  const Vec3d by = random.direction() * (random.chance(0.5) ? 0 : 3 * size);
  std::vector<CloudPoint> points;
  for (int i = 0; i < count; ++i) {
    Vec3d p = random.direction() * (size * random.uniform());
    if (form == 1) p.z = 0;
    if (form == 2)
      for (int k = 0; k < 3; ++k) p[k] = 0.25 * size * random.integer(-4, 4);
    p += by;
    points.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    if (random.chance(0.05)) points.push_back(points.back());
  }
  return points;
}

CloudCase any_case(Random& random, const CloudKind& kind) {
  CloudCase c;
  c.size = random.chance(0.2) ? 100 : random.log_uniform(1e-3, 3);
  c.points = any_points(random, c.size);
  c.edge = kind.has_edge ? static_cast<float>(c.size * random.log_uniform(0.01, 0.5)) : 0;
  c.radius = kind.has_radius ? c.size * random.log_uniform(1e-3, 0.3) : 0;
  c.part = make_cloud_part(c.points, c.edge, c.radius);
  c.reach = random.chance(0.2) ? random.log_uniform(1, 1e4) : random.uniform(0.5, 3);
  c.away = random.chance(0.2) ? 1000 : random.uniform() * (c.reach + c.size);
  const Vec3d t = random.direction() * c.away;
  c.X = random.chance(0.3) ? Pose{t} : random.rotation(t);
  c.obstacle = make_obstacle(*c.part, rotation_of(c.X), c.X.translation, c.reach);
  return c;
}

/// A point near a point of the cloud, a face or corner of its box, or anywhere.
Vec3<float> any_point(Random& random, const CloudCase& c) {
  Vec3d p = exact_place(c.points[static_cast<std::size_t>(random.integer(0, static_cast<int>(c.points.size()) - 1))]);
  Vec3d from = random.direction() * (0.5 * c.edge);
  for (int k = 0; k < 3; ++k)
    if (random.chance(0.5)) from[k] = random.sign() * 0.5 * c.edge;
  const double far = random.chance(0.5) ? random.log_uniform(1e-9, 5) * c.size : c.edge * random.uniform(-0.5, 0.5);
  p += from + random.direction() * (far + c.radius * (random.chance(0.5) ? 1 : random.uniform()));
  p = rotation_of(c.X) * p + c.X.translation;
  if (random.chance(0.1)) p = random.direction() * c.reach;
  if (const double away = norm(p); away > c.reach * 0.9999999) p = p * (0.9999999 * c.reach / away);
  return cast<float>(p);
}

/// Signed distance of a point from a box of half an edge about another one, or from that point.
Real core_gap(const Vec3r& d, const Real& half) {
  Real out = real(0), most = real(-1e30);
  for (int k = 0; k < 3; ++k) {
    const Real beyond = abs(d[k]) - half, outside = larger(beyond, real(0));
    out += outside * outside;
    most = larger(most, beyond);
  }
  return most > 0 ? Real(sqrt(out)) : most;
}

Real exact_gap(const CloudCase& c, const Vec3<float>& of) {
  const Vec3r p = turned(c.X, difference(real({of.x, of.y, of.z}), real(c.X.translation)), true);
  const Real half = real(0.5 * double{c.edge});
  Real least = real(1e30);
  for (const CloudPoint& q : c.points) {
    const Real gap = core_gap(difference(p, real(exact_place(q))), half);
    if (gap < least) least = gap;
  }
  return least - real(c.radius);
}

struct Found {
  int points = 0, inside = 0, near = 0, far = 0, beyond = 0, open = 0, hit = 0;
  double worst = 0;  ///< greatest deviation without limits, as a share of the error
};

/// Eight points and what matters of their gaps.
struct EightCases {
  alignas(32) float x[8], y[8], z[8], beyond[8], open[8], hit[8];

  PointGaps gaps(const Obstacle& o) const {
    PointGaps gaps;
    cloud_gaps_test::cloud_gaps(o, x, y, z, {Eight::load(beyond), Eight::load(open), Eight::load(hit)}, gaps);
    return gaps;
  }
};

void check_without_limits(const CloudCase& c, const EightCases& of, const std::vector<Real>& exact, Found& found) {
  EightCases cases = of;
  std::fill_n(cases.beyond, 8, kAlways);
  std::fill_n(cases.open, 8, kNever);
  std::fill_n(cases.hit, 8, kNever);
  const PointGaps gaps = cases.gaps(*c.obstacle);
  const double error = c.obstacle->error;
  for (std::size_t k = 0; k < 8; ++k) {
    const Real apart = larger(exact[k], real(0));
    ASSERT_LE(real(gaps.low[k]) - real(error), apart) << k;
    ASSERT_GE(real(gaps.high[k]) + real(error), exact[k]) << k;
    const double off = std::abs(Real(real(gaps.high[k]) - exact[k]).get_d());
    if (exact[k] > 0) {
      ASSERT_LE(off, error) << k << ": the nearest element is found";
      found.worst = std::max(found.worst, off / error);
    }
    found.inside += exact[k] < 0;
    found.near += abs(exact[k]) < 1e-5;
    ++found.points;
  }
}

/// The limits are near the gaps; their promises hold beyond the error.
void check_limits(Random& random, const CloudCase& c, const EightCases& of, const std::vector<Real>& exact,
                  Found& found) {
  EightCases cases = of;
  const double error = c.obstacle->error;
  for (std::size_t k = 0; k < 8; ++k) {
    const double gap = exact[k].get_d(), by = random.chance(0.5) ? 10 * error : c.size * random.log_uniform(1e-4, 2);
    const auto near = [&] { return static_cast<float>(gap + random.uniform(-1, 1) * by); };
    cases.hit[k] = random.chance(0.2) ? kNever : near();
    cases.open[k] = random.chance(0.2) ? cases.hit[k] : std::max(near(), cases.hit[k]);
    cases.beyond[k] = std::max(near(), cases.open[k]);
    if (random.chance(0.1)) cases.beyond[k] = cases.open[k] = cases.hit[k] = kNever;
  }
  const PointGaps gaps = cases.gaps(*c.obstacle);
  for (std::size_t k = 0; k < 8; ++k) {
    const double low = gaps.low[k], high = gaps.high[k], gap = exact[k].get_d(), beyond = cases.beyond[k];
    ASSERT_GE(real(high) + real(error), exact[k]) << k;
    if (low > cases.open[k]) {
      ASSERT_LE(real(low) - real(error), larger(exact[k], real(0))) << k;
    }
    if (beyond < 0) continue;
    if (gap > beyond + 2 * error) {
      ++found.beyond;
      ASSERT_GT(low, beyond) << k;
    }
    if (gap > 0 && gap <= cases.open[k] - 2 * error) {
      ++found.open;
      ASSERT_LE(low, cases.open[k]) << k;
      ASSERT_LE(high, cases.open[k]) << k;
    }
    if (gap > 0 && gap < cases.hit[k] - 2 * error) {
      ++found.hit;
      ASSERT_LT(high, cases.hit[k]) << k;
    }
  }
}

void check_case(Random& random, const CloudKind& kind, Found& found) {
  const CloudCase c = any_case(random, kind);
  ASSERT_TRUE(c.obstacle);
  ASSERT_LT(c.obstacle->error, 4e-6 * (c.reach + c.away + 10 * c.size));
  found.far += c.away >= 1000;
  EightCases cases;
  std::vector<Real> exact;
  for (int k = 0; k < 8; ++k) {
    const Vec3<float> p = any_point(random, c);
    cases.x[k] = p.x, cases.y[k] = p.y, cases.z[k] = p.z;
    exact.push_back(exact_gap(c, p));
  }
  ASSERT_NO_FATAL_FAILURE(check_without_limits(c, cases, exact, found));
  ASSERT_NO_FATAL_FAILURE(check_limits(random, c, cases, exact, found));
}

class CloudKinds : public testing::TestWithParam<CloudKind> {};

TEST_P(CloudKinds, GapsHoldTheExactDistance) {
  mpf_set_default_prec(kBits);
  Random random(61);
  Found found;
  for (int i = 0; i < kCases && !HasFatalFailure(); ++i) {
    SCOPED_TRACE(i);
    check_case(random, GetParam(), found);
  }
  std::printf("%s: %d points, %d inside, %d near, %d far; %d beyond, %d open, %d hit; worst %.2f\n", GetParam().name,
              found.points, found.inside, found.near, found.far, found.beyond, found.open, found.hit, found.worst);
  EXPECT_EQ(found.points, 8 * kCases);
  EXPECT_TRUE(found.inside > kCases / 2 || !(GetParam().has_edge || GetParam().has_radius));
  EXPECT_GT(found.near, 100);
  EXPECT_GT(found.far, 20);
  EXPECT_GT(std::min({found.beyond, found.open, found.hit}), kCases / 3);
  EXPECT_GT(found.worst, 0.15);
}

INSTANTIATE_TEST_SUITE_P(All, CloudKinds,
                         testing::Values(CloudKind{"points", false, false}, CloudKind{"balls", false, true},
                                         CloudKind{"voxels", true, false}, CloudKind{"grown_voxels", true, true}),
                         [](const auto& kind) { return std::string(kind.param.name); });

TEST(CloudGaps, OfPointsFarFromTheirOriginThereAreNone) {
  const std::vector<CloudPoint> far{{0, 0, 0}, {1.1e6f, 0, 0}}, near{{0, 0, 0}, {0.9e6f, 0, 0}};
  EXPECT_FALSE(make_obstacle(*make_cloud_part(far, 0, 0), Mat3d::identity(), {0, 0, 0}, 1));
  EXPECT_TRUE(make_obstacle(*make_cloud_part(near, 0, 0), Mat3d::identity(), {0, 0, 0}, 1));
}

}  // namespace
}  // namespace clearance::exact
