// Vertices that a convex part keeps: never one too few, and not needlessly many.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <span>

#include "engine/base/orientation.h"
#include "engine/hull/hull.h"
#include "engine/hull/mesh_rows.h"
#include "engine/hull/qhull_guess.h"
#include "engine/hull/shapes.h"
#include "engine/pose/pose.h"

namespace clearance {
namespace {

using Points = std::vector<Vec3d>;

// The largest n . v. Exact for points on the grid 2^-20 Z within [-4, 4] and integer n up to 2^20, as each dot product
// is.
double exact_support(const Points& points, const Vec3d& n) {
  double best = -HUGE_VAL;
  for (const Vec3d& v : points) best = std::max(best, dot(n, v));
  return best;
}

Vec3d integer_direction(std::mt19937_64& random) {
  std::uniform_int_distribution<int> entry(-(1 << 20), 1 << 20);
  return {double(entry(random)), double(entry(random)), double(entry(random))};
}

double on_grid(double x) {
  return std::round(x * 0x1p20) * 0x1p-20;
}
Vec3d on_grid(const Vec3d& v) {
  return {on_grid(v.x), on_grid(v.y), on_grid(v.z)};
}

void expect_same_hull(const Points& all, const Hull& hull, std::mt19937_64& random) {
  for (int i = 0; i < 1000; ++i) {
    const Vec3d n = integer_direction(random);
    ASSERT_EQ(exact_support(hull.vertices, n), exact_support(all, n)) << "direction " << i;
  }
}

Vec3d unit(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const Vec3d v{normal(random), normal(random), normal(random)};
  return v * (1 / norm(v));
}

TEST(Orientation, AgreesWithIntegersAndIsExactOnPlanes) {
  std::mt19937_64 random(1);
  std::uniform_int_distribution<int> entry(-1000, 1000);
  int zeros = 0, positive = 0, negative = 0;
  for (int i = 0; i < 20000; ++i) {
    long long p[4][3];
    for (auto& row : p)
      for (long long& x : row) x = entry(random);
    if (i % 2) {  // on the plane of the first three
      const int s = entry(random) % 5, t = entry(random) % 5;
      for (int k = 0; k < 3; ++k) p[3][k] = p[0][k] + s * (p[1][k] - p[0][k]) + t * (p[2][k] - p[0][k]);
      if (i % 4 == 1) p[3][i % 3] += i % 8 == 1 ? 1 : -1;  // or next to it
    }
    long long d[3][3];
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 3; ++k) d[r][k] = p[r + 1][k] - p[0][k];
    const long long det = d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) -
                          d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                          d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
    const int wanted = (det > 0) - (det < 0);
    zeros += wanted == 0;
    positive += wanted > 0;
    negative += wanted < 0;
    // The same far from the origin, and at other scales: exact, so the result is the same.
    for (const auto& [scale, shift] : {std::pair{1.0, 0.0}, {1.0, 0x1p40}, {0x1p-180, 0.0}, {0x1p150, 0x1p190}}) {
      Vec3d v[4];
      for (int r = 0; r < 4; ++r)
        v[r] = {double(p[r][0]) * scale + shift, double(p[r][1]) * scale - shift, double(p[r][2]) * scale + shift};
      ASSERT_EQ(orientation(v[0], v[1], v[2], v[3]), wanted);
    }
  }
  EXPECT_GT(zeros, 2000);
  EXPECT_GT(positive, 2000);
  EXPECT_GT(negative, 2000);
}

TEST(Orientation, SeesTheLastBit) {
  // A plane through points with many digits, and a point on it up to rounding: moving it by one unit in the last place
  // of one coordinate moves it across. Differences are multiples of 2^-38, so that integers give the exact result.
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> entry(1, 2);
  int near = 0;
  for (int i = 0; i < 3000; ++i) {
    Vec3d v[4];
    for (Vec3d& p : v) p = {entry(random), entry(random), entry(random)};
    const double s = entry(random) - 1, t = entry(random) - 1;
    v[3] = v[0] + s * (v[1] - v[0]) + t * (v[2] - v[0]);
    __int128 d[3][3];
    bool small = true;
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 3; ++k) {
        const double difference =
            v[r + 1][k] - v[0][k];  // exact here (Sterbenz, or the same binade), a multiple of 2^-52
        small = small && v[r + 1][k] >= 0.5 && v[r + 1][k] < 4;
        d[r][k] = static_cast<__int128>(difference * 0x1p38);  // 38 bits each: a product of three needs 114 and fits
        v[r + 1][k] = v[0][k] + static_cast<double>(d[r][k]) * 0x1p-38;
        small = small && v[r + 1][k] - v[0][k] == static_cast<double>(d[r][k]) * 0x1p-38;
      }
    if (!small) continue;
    const __int128 det = d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) -
                         d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                         d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
    near += static_cast<double>(det < 0 ? -det : det) < 0x1p80;
    ASSERT_EQ(orientation(v[0], v[1], v[2], v[3]), (det > 0) - (det < 0));
  }
  EXPECT_GT(near, 2000);
}

TEST(Hull, InnerPointsAreDroppedAndTheSupportIsTheSame) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> radius(0, 1);
  for (const int count : {5, 12, 100, 3000}) {
    Points all;
    for (int i = 0; i < count; ++i) all.push_back(on_grid(unit(random) * std::cbrt(radius(random))));
    all.push_back(on_grid(Vec3d{0.001, 0.002, 0.003}));
    const Hull hull = reduce_to_hull(all);
    EXPECT_LE(hull.vertices.size(), all.size());
    if (count >= 100) {
      EXPECT_LT(hull.vertices.size(), all.size() * 3 / 4) << count;
    }
    expect_same_hull(all, hull, random);
  }
}

TEST(Hull, KeptAreExactlyTheCornersWhereOthersAreDeepInside) {
  std::mt19937_64 random(4);
  Points all = make_box({2, 2, 2}).vertices;
  std::uniform_real_distribution<double> inside(-0.9, 0.9);
  for (int i = 0; i < 500; ++i) all.insert(all.begin() + i % 5, Vec3d{inside(random), inside(random), inside(random)});
  const Hull hull = reduce_to_hull(all);
  EXPECT_EQ(hull.vertices.size(), 8u);
  EXPECT_EQ(hull.triangles.size(), 12u);
  double volume = 0;
  for (const Triangle& t : hull.triangles)
    volume += dot(hull.vertices[t[0]], cross(hull.vertices[t[1]], hull.vertices[t[2]])) / 6;
  EXPECT_NEAR(volume, 8, 1e-12);
}

TEST(Hull, PointsOnFacesAndEdgesAreDroppedWhereExactlyThere) {
  // A subdivided box: every face a grid of points, exactly coplanar.
  Points all;
  for (int x = 0; x <= 16; ++x)
    for (int y = 0; y <= 16; ++y)
      for (int z = 0; z <= 16; ++z)
        if (x % 16 == 0 || y % 16 == 0 || z % 16 == 0)
          all.push_back({x * 0.1, y * 0.25, z * 3.0});  // 0.1 x is rounded, once for all of a plane
  const Hull hull = reduce_to_hull(all);
  EXPECT_LT(hull.vertices.size(), all.size() / 20) << "of " << all.size();
  for (const double x : {0.0, 16 * 0.1})
    for (const double y : {0.0, 4.0})
      for (const double z : {0.0, 48.0})
        EXPECT_EQ(std::count_if(hull.vertices.begin(), hull.vertices.end(),
                                [&](const Vec3d& v) { return v.x == x && v.y == y && v.z == z; }),
                  1);
  std::mt19937_64 random(5);
  Points grid;
  for (const Vec3d& v : all) grid.push_back(on_grid(v));
  expect_same_hull(grid, reduce_to_hull(grid), random);
}

TEST(Hull, NearlyCoplanarPointsAreDecidedByTheLastBit) {
  // A rotated box whose faces carry points that lie on them only up to rounding (to 2^-52): half of them are outside by
  // that much. Directions near the normals of faces distinguish them; supports are compared in integers, exactly.
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> entry(-1, 1);
  const Mat3d R = rotation_of(Pose{{0, 0, 0}, 0.9, 0.1, -0.3, 0.2});
  const auto fine_grid = [](double x) { return std::round(x * 0x1p52) * 0x1p-52; };
  const auto turned = [&](const Vec3d& v) {
    const Vec3d w = R * v;
    return Vec3d{fine_grid(w.x), fine_grid(w.y), fine_grid(w.z)};
  };
  const Shape box = make_box({2, 2, 2});
  Points all;
  for (const Vec3d& v : box.vertices) all.push_back(turned(v));
  for (int i = 0; i < 3000; ++i) {
    Vec3d v{entry(random), entry(random), entry(random)};
    v[i % 3] = i % 2 ? 1 : -1;
    all.push_back(turned(v));
  }
  int outside = 0;  // beyond both triangles of a face
  for (std::size_t i = 8; i < all.size(); ++i)
    for (std::size_t t = 0; t < box.triangles.size(); t += 2) {
      const auto beyond = [&](const Triangle& c) { return orientation(all[c[0]], all[c[1]], all[c[2]], all[i]) > 0; };
      outside += beyond(box.triangles[t]) && beyond(box.triangles[t + 1]);
    }
  EXPECT_GT(outside, 200);

  const Hull hull = reduce_to_hull(all);
  EXPECT_GT(hull.vertices.size(), 20u);
  EXPECT_LT(hull.vertices.size(), all.size() - 500);
  int away_from_corners = 0;
  for (int i = 0; i < 1000; ++i) {
    std::array<__int128, 3> n;
    for (int k = 0; k < 3; ++k) {
      const double normal = R.row[k][i % 3] * (i % 2 ? 1 : -1);
      n[k] = static_cast<__int128>(std::llround(normal * 0x1p50)) + static_cast<__int128>(entry(random) * 8);
    }
    const auto support = [&](std::span<const Vec3d> points) {
      __int128 best = -(static_cast<__int128>(1) << 120);
      for (const Vec3d& v : points) {
        __int128 sum = 0;
        for (int k = 0; k < 3; ++k) sum += n[k] * static_cast<__int128>(std::llround(v[k] * 0x1p52));
        best = std::max(best, sum);
      }
      return best;
    };
    ASSERT_TRUE(support(hull.vertices) == support(all)) << "direction " << i;
    away_from_corners += support(all) > support({all.data(), 8});
  }
  EXPECT_GT(away_from_corners, 100);
}

TEST(Hull, FlatStraightAndSinglePointSetsAreKeptWhole) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> entry(-1, 1);
  Points flat, line, tilted;
  for (int i = 0; i < 200; ++i) {
    const double s = entry(random), t = entry(random);
    flat.push_back({s, t, 0.5});
    tilted.push_back(on_grid(Vec3d{s, t, 0}) + Vec3d{0, 0, on_grid(s) + on_grid(t)});  // exactly on z = x + y
    line.push_back(Vec3d{1, 2, 3} * on_grid(s));
  }
  for (const Points& points : {flat, tilted, line, Points{{1, 2, 3}}, Points{{0, 0, 0}, {1, 1, 1}}}) {
    const Hull hull = reduce_to_hull(points);
    EXPECT_EQ(hull.vertices.size(), points.size());
  }
  const Points same(50, Vec3d{1, -0.0, 3});
  EXPECT_EQ(reduce_to_hull(same).vertices.size(), 1u);
}

TEST(Hull, ScalesAndPlacesMakeNoDifference) {
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> radius(0, 1);
  Points unit_ball;
  for (int i = 0; i < 400; ++i) unit_ball.push_back(on_grid(unit(random) * std::cbrt(radius(random))));
  const std::size_t wanted = reduce_to_hull(unit_ball).vertices.size();
  EXPECT_LT(wanted, 200u);
  for (const double scale : {0x1p-100, 0x1p-30, 0x1p40, 0x1p120})
    for (const Vec3d& stretch : {Vec3d{1, 1, 1}, Vec3d{1, 0x1p-30, 1}, Vec3d{0x1p20, 1, 0x1p-20}}) {
      Points moved;
      for (const Vec3d& v : unit_ball)
        moved.push_back({scale * stretch.x * v.x, scale * stretch.y * v.y, scale * stretch.z * v.z});
      EXPECT_EQ(reduce_to_hull(moved).vertices.size(), wanted) << scale;
    }
  Points far;
  for (const Vec3d& v : unit_ball) far.push_back(v + Vec3d{0x1p30, -0x1p31, 0x1p32});  // exact: 2^-20 to 2^32
  EXPECT_EQ(reduce_to_hull(far).vertices.size(), wanted);
  // Beyond the range of exact tests nothing is dropped.
  Points tiny;
  for (const Vec3d& v : unit_ball) tiny.push_back(v * 1e-80);
  EXPECT_EQ(reduce_to_hull(tiny).vertices.size(), tiny.size());
}

TEST(Hull, LargeConvexMeshesAreTakenAsTheyAre) {
  Shape sphere = make_uv_sphere(2, 100);
  for (Vec3d& v : sphere.vertices)
    v = {double(float(v.x)), double(float(v.y)), double(float(v.z))};  // as in mesh files
  ASSERT_GT(sphere.vertices.size(), kHullCheckVertices);
  EXPECT_TRUE(MeshRows(sphere.vertices.size(), sphere.triangles).is_convex(sphere.vertices));
  const Hull hull = reduce_to_hull(sphere.vertices, sphere.triangles);
  EXPECT_EQ(hull.vertices.size(), sphere.vertices.size());
  EXPECT_EQ(hull.triangles, sphere.triangles);

  Shape dented = sphere;
  dented.vertices[5000] = dented.vertices[5000] * 0.9;
  EXPECT_FALSE(MeshRows(dented.vertices.size(), dented.triangles).is_convex(dented.vertices));
  EXPECT_EQ(reduce_to_hull(dented.vertices, dented.triangles).vertices.size(), dented.vertices.size() - 1);
  Shape open = sphere;
  open.triangles.pop_back();
  EXPECT_FALSE(MeshRows(open.vertices.size(), open.triangles).is_convex(open.vertices));
  Shape inside_out = sphere;
  for (Triangle& t : inside_out.triangles) std::swap(t[1], t[2]);
  EXPECT_FALSE(MeshRows(inside_out.vertices.size(), inside_out.triangles).is_convex(inside_out.vertices));
}

TEST(Hull, LargeSetsLoseTheirBulk) {
  std::mt19937_64 random(10);
  std::uniform_real_distribution<double> radius(0, 1);
  Points all;
  for (int i = 0; i < 60000; ++i) all.push_back(on_grid(unit(random) * std::cbrt(radius(random))));
  const Hull hull = reduce_to_hull(all);
  EXPECT_LT(hull.vertices.size(), 4000u);
  EXPECT_EQ(hull.vertices.size(), [&] {  // exactly Qhull's corners: every other point was proved inside
    std::set<std::uint32_t> corners;
    for (const Triangle& t : qhull_triangles(all)) corners.insert(t.begin(), t.end());
    return corners.size();
  }());
  expect_same_hull(all, hull, random);
}

}  // namespace
}  // namespace clearance
