// Supports: scan, tree and double-double find the true maximum over all vertices; climbing proposes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/shapes.h"
#include "engine/support.h"
#include "engine_test_util.h"

namespace clearance::test {
namespace {

// The exact maximum, as far as 64-bit long doubles can tell.
long double brute_force(const Piece& piece, const Vec3d& n) {
  long double best = -INFINITY;
  for (const Vec3d& v : piece.vertices) {
    const long double s = static_cast<long double>(n.x) * v.x + static_cast<long double>(n.y) * v.y + static_cast<long double>(n.z) * v.z;
    best = std::max(best, s);
  }
  return best;
}

std::vector<PiecePtr> pieces_of_every_size() {
  Random random(17);
  std::vector<PiecePtr> pieces;
  for (const int count : {1, 2, 7, 8, 15, 16, 17, 100, 256, 257, 1000, 20000})
    pieces.push_back(make_piece(random.cloud(count, {1, 2, 0.5})));
  pieces.push_back(make_piece(make_uv_sphere(2, 40).vertices));   // rings of equal heights: many ties
  pieces.push_back(make_piece(random.cloud(3000, {1, 1, 0})));    // flat
  pieces.push_back(make_piece(std::vector<Vec3d>(500, Vec3d{1, 2, 3})));  // all the same
  return pieces;
}

TEST(Support, IsTheMaximumOverAllVerticesWithinRounding) {
  Random random(5);
  int with_tree = 0, without = 0;
  for (const PiecePtr& piece : pieces_of_every_size()) {
    ++(piece->tree ? with_tree : without);
    for (int i = 0; i < 300; ++i) {
      Vec3d n{random.normal(), random.normal(), random.normal()};
      if (i % 10 == 0) n = {0, 0, i % 20 ? 1.0 : -1.0};
      const long double exact = brute_force(*piece, n);
      const double slack = 3 * 0x1p-53 * norm(n) * piece->rho;
      const auto hint = static_cast<std::uint32_t>(random.below(piece->vertices.size()));
      const SupportPoint<double> s = support(*piece, n, hint);
      EXPECT_EQ(s.value, dot(n, piece->vertices[s.index]));
      EXPECT_LE(std::abs(static_cast<double>(s.value - exact)), slack);
      const SupportPoint<DoubleDouble> fine = support(*piece, cast<DoubleDouble>(n), hint);
      const double error = std::abs(static_cast<double>(static_cast<long double>(fine.value.hi) + fine.value.lo - exact));
      EXPECT_LE(error, 1e-18 * norm(n) * piece->rho);
    }
  }
  EXPECT_GT(with_tree, 3);
  EXPECT_GT(without, 3);
}

TEST(Support, TreeAndScanAgreeWhateverTheHint) {
  Random random(6);
  const std::vector<Vec3d> cloud = random.cloud(5000, {1, 1, 1});
  const PiecePtr piece = make_piece(cloud);
  ASSERT_TRUE(piece->tree);
  for (int i = 0; i < 500; ++i) {
    const Vec3d n{random.normal(), random.normal(), random.normal()};
    std::uint32_t best = 0;
    for (std::uint32_t k = 1; k < cloud.size(); ++k)
      if (dot(n, cloud[k]) > dot(n, cloud[best])) best = k;
    EXPECT_EQ(support(*piece, n, static_cast<std::uint32_t>(random.below(cloud.size()))).index, best);
  }
}

TEST(Support, ClimbingReachesTheTopOfASphere) {
  const Shape sphere = make_uv_sphere(1, 30);
  std::vector<std::vector<std::uint32_t>> neighbours(sphere.vertices.size());
  for (const auto& t : sphere.triangles)
    for (int k = 0; k < 3; ++k) {
      neighbours[t[k]].push_back(t[(k + 1) % 3]);
      neighbours[t[(k + 1) % 3]].push_back(t[k]);
    }
  std::vector<std::uint32_t> begin{0}, all;
  for (const auto& n : neighbours) {
    all.insert(all.end(), n.begin(), n.end());
    begin.push_back(static_cast<std::uint32_t>(all.size()));
  }
  const PiecePtr piece = make_piece(sphere.vertices, 0, 0, begin, all);
  Random random(9);
  for (int i = 0; i < 300; ++i) {
    const Vec3d n{random.normal(), random.normal(), random.normal()};
    const auto hint = static_cast<std::uint32_t>(random.below(piece->vertices.size()));
    EXPECT_NEAR(climb(*piece, n, hint).value, support(*piece, n).value, 1e-12 * norm(n));
  }
}

}  // namespace
}  // namespace clearance::test
