// Supports: scan, direction table and double-double find the exact maximum over all vertices.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/hull/direction_table.h"
#include "engine/hull/shapes.h"
#include "engine/hull/support.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

// The exact maximum, to the precision of 64-bit long doubles.
long double brute_force(const ConvexPart& part, const Vec3d& n) {
  long double best = -INFINITY;
  for (const Vec3d& v : part.vertices) {
    const long double s =
        static_cast<long double>(n.x) * v.x + static_cast<long double>(n.y) * v.y + static_cast<long double>(n.z) * v.z;
    best = std::max(best, s);
  }
  return best;
}

std::vector<ConvexPartPtr> parts_of_every_size() {
  Random random(17);
  std::vector<ConvexPartPtr> parts;
  for (const int count : {1, 2, 7, 8, 15, 16, 17, 64, 65, 100, 257, 1000, 20000})
    parts.push_back(make_convex_part(random.cloud(count, {1, 2, 0.5})));
  parts.push_back(make_convex_part(make_uv_sphere(2, 40).vertices));           // rings of equal heights: many ties
  parts.push_back(make_convex_part(random.cloud(3000, {1, 1, 0})));            // flat
  parts.push_back(make_convex_part(std::vector<Vec3d>(500, Vec3d{1, 2, 3})));  // all equal
  return parts;
}

TEST(Support, IsTheMaximumOverAllVerticesWithinRounding) {
  Random random(5);
  int with_table = 0, without = 0;
  for (const ConvexPartPtr& part : parts_of_every_size()) {
    ++(part->table ? with_table : without);
    for (int i = 0; i < 300; ++i) {
      Vec3d n{random.normal(), random.normal(), random.normal()};
      if (i % 10 == 0) n = {0, 0, i % 20 ? 1.0 : -1.0};
      const long double exact = brute_force(*part, n);
      const double slack = 3 * 0x1p-53 * norm(n) * part->rho;
      const SupportPoint<double> s = support(*part, n);
      EXPECT_EQ(s.value, dot(n, part->vertices[s.index]));
      EXPECT_LE(std::abs(static_cast<double>(s.value - exact)), slack);
      const SupportPoint<DoubleDouble> fine = support(*part, cast<DoubleDouble>(n));
      const double error =
          std::abs(static_cast<double>(static_cast<long double>(fine.value.hi) + fine.value.lo - exact));
      EXPECT_LE(error, 1e-18 * norm(n) * part->rho);
    }
  }
  EXPECT_GT(with_table, 3);
  EXPECT_GT(without, 3);
}

// Directions that lie on the folds and borders of the table's map, and random ones.
std::vector<Vec3d> directions(Random& random) {
  std::vector<Vec3d> all;
  for (int x = -4; x <= 4; ++x)
    for (int y = -4; y <= 4; ++y)
      for (int z = -4; z <= 4; ++z)
        if (x || y || z) all.push_back({x * 0.25, y * 0.25, z * 0.25});
  for (int i = 0; i < 1000; ++i) {
    Vec3d n{random.normal(), random.normal(), random.normal()};
    if (i % 3 == 1) n[i % 9 / 3] *= 1e-12;
    all.push_back(n * std::pow(10.0, i % 7 * 10 - 30));
  }
  return all;
}

TEST(DirectionTable, FindsTheVertexThatAScanFinds) {
  Random random(6);
  std::vector<std::vector<Vec3d>> clouds{random.cloud(5000, {1, 1, 1}), make_uv_sphere(2, 25).vertices,
                                         make_uv_sphere(1, 60).vertices};
  clouds.push_back(random.cloud(300, {1, 1e-9, 1e-3}));                                           // a needle
  clouds.push_back(random.cloud(300, {1, 1, 0}));                                                 // flat
  clouds.push_back(std::vector<Vec3d>(100, {1, 2, 3}));                                           // a point
  for (Vec3d& v : clouds.emplace_back(random.cloud(500, {1, 1, 1}))) v += Vec3d{1e9, -3e9, 2e9};  // far from its frame
  for (Vec3d& v : clouds.emplace_back(random.cloud(400, {1, 1, 1})))
    v = {std::round(v.x), std::round(v.y), std::round(v.z)};
  const Shape box = make_box({1, 2, 3});
  for (int i = 0; i < 20; ++i)
    clouds.back().insert(clouds.back().end(), box.vertices.begin(), box.vertices.end());  // repeats
  for (const std::vector<Vec3d>& cloud : clouds) {
    const ConvexPartPtr part = make_convex_part(cloud);
    ASSERT_TRUE(part->table);
    const DirectionTable blurred = make_direction_table(cloud, part->rho, {4, 1, float_blur(part->spread)});
    int in_float = 0;
    for (const Vec3d& n : directions(random)) {
      std::uint32_t best = 0;
      for (std::uint32_t k = 1; k < cloud.size(); ++k)
        if (dot(n, cloud[k]) > dot(n, cloud[best])) best = k;
      ASSERT_EQ(support(*part, n).index, best) << cloud.size() << " vertices, " << n.x << ' ' << n.y << ' ' << n.z;
      // The list also contains every vertex that rounding might make the farthest.
      const auto list = part->table->candidates(n);
      for (std::uint32_t k = 0; k < cloud.size(); ++k) {
        const bool may_be_farthest = dot(n, cloud[k]) >= dot(n, cloud[best]) - 32 * 0x1p-53 * norm(n) * part->rho;
        ASSERT_TRUE(!may_be_farthest || std::binary_search(list.begin(), list.end(), k));
      }
      // The same for a direction that is looked up in float32.
      const Vec3<float> f = cast<float>(n);
      const float size = std::abs(f.x) + std::abs(f.y) + std::abs(f.z);
      if (!(size > 1e-30f && size < 1e30f)) continue;
      ++in_float;
      for (const double off : {-1.0, 0.0, 1.0}) {  // the largest errors of a device's quotients
        const CellPoint cell = cell_point(f, static_cast<float>((1 + off * 0x1p-23) / static_cast<double>(size)));
        const std::uint32_t* found =
            blurred.lists.data() + find_list(blurred.cells.data(), blurred.grid_bits, cell.u, cell.v);
        ASSERT_TRUE(std::binary_search(found + 1, found + 1 + found[0], best));
      }
    }
    EXPECT_GT(in_float, 1000);
  }
}

TEST(DirectionTable, ListsAreShortWhateverTheMesh) {
  Random random(8);
  struct Mesh {
    const char* what;
    std::vector<Vec3d> vertices;
    double most;  // mean number of vertices per list
  };
  for (const Mesh& m :
       {Mesh{"sphere", make_uv_sphere(1, 100).vertices, 7}, Mesh{"cloud", random.cloud(20000, {1, 1, 1}), 7},
        Mesh{"cylinder", make_cylinder(1, 2).vertices, 7}}) {
    const ConvexPartPtr part = make_convex_part(m.vertices);
    double sum = 0;
    std::size_t longest = 0;
    for (int i = 0; i < 2000; ++i) {
      const std::size_t size = part->table->candidates({random.normal(), random.normal(), random.normal()}).size();
      sum += static_cast<double>(size);
      longest = std::max(longest, size);
    }
    std::printf("%s: %zu vertices, %.2f looked at on average, %zu at most, %.1f bytes each\n", m.what,
                m.vertices.size(), sum / 2000, longest,
                static_cast<double>(part->table->bytes()) / static_cast<double>(m.vertices.size()));
    EXPECT_LT(sum / 2000, m.most) << m.what;
    EXPECT_LT(longest, 64u) << m.what;
  }
}

}  // namespace
}  // namespace clearance::test
