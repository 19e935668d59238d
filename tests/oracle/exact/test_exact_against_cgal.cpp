// Compares the oracle with CGAL's exact polytope distance and exact convex hull.
#include <CGAL/Gmpq.h>
#include <CGAL/Polyhedron_3.h>
#include <CGAL/Polytope_distance_d.h>
#include <CGAL/Polytope_distance_d_traits_3.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/convex_hull_3.h>
#include <gtest/gtest.h>

#include <optional>
#include <random>

#include "tests/oracle/exact/exact_distance.h"

namespace clearance::exact {
namespace {

using Kernel = CGAL::Simple_cartesian<CGAL::Gmpq>;
using Point = Kernel::Point_3;
using Distance = CGAL::Polytope_distance_d<CGAL::Polytope_distance_d_traits_3<Kernel, CGAL::Gmpq, CGAL::Gmpq>>;

CGAL::Gmpq q(double v) {
  return CGAL::Gmpq(v);
}
CGAL::Gmpq q(const mpz_class& n, const mpz_class& d) {
  mpq_class r(n, d);
  r.canonicalize();
  return CGAL::Gmpq(r.get_mpq_t());
}

/// Vertices in the world, as rationals: the textbook rotation, independent of the oracle's integers.
std::vector<Point> placed(const std::vector<Vec3d>& vertices, const Pose& X) {
  const CGAL::Gmpq w = q(X.qw), x = q(X.qx), y = q(X.qy), z = q(X.qz), n = w * w + x * x + y * y + z * z;
  std::vector<Point> out;
  for (const Vec3d& v : vertices) {
    // q v q* / |q|^2 by way of t = 2 (u x v): v + w t / n + (u x t) / n.
    const CGAL::Gmpq vx = q(v.x), vy = q(v.y), vz = q(v.z), tx = 2 * (y * vz - z * vy), ty = 2 * (z * vx - x * vz),
                     tz = 2 * (x * vy - y * vx);
    out.emplace_back(vx + (w * tx + y * tz - z * ty) / n + q(X.translation.x),
                     vy + (w * ty + z * tx - x * tz) / n + q(X.translation.y),
                     vz + (w * tz + x * ty - y * tx) / n + q(X.translation.z));
  }
  return out;
}

/// Squared depth: the nearest facet plane of the hull of B - A, seen from the origin, which must be inside.
CGAL::Gmpq squared_depth(const std::vector<Point>& a, const std::vector<Point>& b) {
  std::vector<Point> c;
  for (const Point& p : a)
    for (const Point& s : b) c.push_back(CGAL::ORIGIN + (s - p));
  CGAL::Polyhedron_3<Kernel> hull;
  CGAL::convex_hull_3(c.begin(), c.end(), hull);
  std::optional<CGAL::Gmpq> best;
  for (auto f = hull.facets_begin(); f != hull.facets_end(); ++f) {
    const auto h = f->halfedge();
    const Kernel::Plane_3 plane(h->vertex()->point(), h->next()->vertex()->point(),
                                h->next()->next()->vertex()->point());
    const CGAL::Gmpq d = CGAL::squared_distance(Point(CGAL::ORIGIN), plane);
    if (!best || d < *best) best = d;
  }
  return *best;
}

TEST(ExactAgainstCgal, SameSquaredDistanceAndDepth) {
  std::mt19937_64 random(21);
  std::normal_distribution<double> normal;
  int apart = 0, deep = 0, flat = 0;
  for (int i = 0; i < 240; ++i) {
    const bool lattice = i % 3 == 0, needle = i % 3 == 1;
    const auto cloud = [&](int count) {
      std::vector<Vec3d> v;
      for (int k = 0; k < count; ++k) {
        Vec3d p{normal(random), normal(random), normal(random)};
        if (lattice && i % 2) p.z = 0;
        if (lattice) p = {std::round(2 * p.x), std::round(2 * p.y), std::round(2 * p.z)};
        if (needle) p = {p.x, p.y * 1e-6, p.z * 1e-9};
        v.push_back(p);
      }
      return v;
    };
    const auto pose = [&](double reach) {
      Pose X{{reach * normal(random), reach * normal(random), reach * normal(random)},
             normal(random),
             normal(random),
             normal(random),
             normal(random)};
      if (lattice)
        X = {{std::round(X.translation.x), std::round(X.translation.y), i % 2 ? 0 : std::round(X.translation.z)},
             1,
             0,
             0,
             static_cast<double>(random() % 2)};
      return X;
    };
    const std::vector<Vec3d> a = cloud(1 + static_cast<int>(random() % 9)),
                             b = cloud(1 + static_cast<int>(random() % 9));
    const Pose Xa = pose(1), Xb = pose(1);
    const Result r = exact_distance({a, 0}, Xa, {b, 0}, Xb);
    const std::vector<Point> pa = placed(a, Xa), pb = placed(b, Xb);
    Distance cgal(pa.begin(), pa.end(), pb.begin(), pb.end());
    const CGAL::Gmpq d2 = cgal.squared_distance_numerator() / cgal.squared_distance_denominator();
    if (r.distance.sign > 0) {
      ++apart;
      ASSERT_EQ(q(r.distance.numerator, r.distance.denominator), d2) << "case " << i;
      continue;
    }
    ASSERT_EQ(d2, CGAL::Gmpq(0)) << "case " << i;
    ASSERT_TRUE(r.cores_overlap);
    if (r.simplex.empty()) {
      ++flat;
      EXPECT_EQ(r.distance.sign, 0);
      continue;
    }
    deep += r.distance.sign < 0;
    ASSERT_EQ(q(r.distance.numerator, r.distance.denominator), squared_depth(pa, pb)) << "case " << i;
  }
  EXPECT_GT(apart, 60);
  EXPECT_GT(deep, 30);
  EXPECT_GT(flat, 3);
}

}  // namespace
}  // namespace clearance::exact
