// Meshes as lists: every vertex once, in the order of a walk, for any slices.
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <set>
#include <vector>

#include "engine/bvh/surface_rows.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/cases/mesh_shapes.h"

namespace clearance {
namespace {

struct Tally {
  int meshes = 0, repeated = 0, parts = 0;
};

bool same(const Vec3d& a, const Vec3d& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

// Lists in slices of `steps` steps.
// \param slices receives their number
SurfaceRows listed(const Surface& surface, std::size_t steps, std::size_t& slices) {
  SurfaceLister lister(surface);
  for (slices = 1; !lister.advance(steps); ++slices) {
  }
  EXPECT_TRUE(lister.advance(1)) << "and stays so";
  return lister.rows();
}

void check(const Surface& surface, Tally& tally) {
  std::size_t slices = 0, whole = 0;
  const SurfaceRows rows = listed(surface, 7, slices), at_once = listed(surface, ~std::size_t{0}, whole);
  EXPECT_EQ(whole, 1u);
  EXPECT_GT(slices, 3 * surface.size() / 7) << "a step is a small part";
  EXPECT_EQ(rows.corners, at_once.corners);
  ASSERT_EQ(rows.corners_each, 3u);
  ASSERT_EQ(rows.corners.size(), 3 * std::size_t{surface.size()});
  EXPECT_EQ(rows.loaded, surface.vertices().size());
  std::set<std::array<double, 3>> seen;
  for (const Vec3d& v : rows.vertices) EXPECT_TRUE(seen.insert({v.x, v.y, v.z}).second) << "once";
  std::vector<std::set<std::uint32_t>> beside(rows.vertices.size());
  for (std::uint32_t t = 0; t < surface.size(); ++t) {
    const auto corners = surface.corners(t);
    const auto element = rows.element(t);
    for (std::size_t k = 0; k < 3; ++k) {
      ASSERT_LT(element[k], rows.vertices.size());
      EXPECT_TRUE(same(rows.vertices[element[k]], corners[k]));
      beside[element[k]].insert(element.begin(), element.end());
    }
  }
  // A connected component is contiguous: a vertex without an earlier neighbour begins one.
  std::size_t parts = 0;
  for (std::uint32_t v = 0; v < rows.vertices.size(); ++v) {
    ASSERT_FALSE(beside[v].empty()) << "named by a triangle";
    parts += *beside[v].begin() == v;
  }
  EXPECT_EQ(parts, surface.parts().size());
  ++tally.meshes;
  tally.parts += parts > 1;
  tally.repeated += rows.vertices.size() < rows.loaded;
}

TEST(SurfaceRows, ListEveryVertexOnceInTheOrderOfAWalk) {
  Tally tally;
  for (const exact::CaseClass& cls : exact::mesh_classes())
    for (std::uint64_t i = 0; i < 3; ++i) {
      const exact::Case c = exact::make_case(cls, 31, i);
      for (const exact::SolidPtr& s : {c.a, c.b})
        if (!s->triangles.empty()) check(Surface(s->vertices, s->triangles, false), tally);
    }
  std::printf("%d meshes, %d of several parts, %d with vertices that are there twice\n", tally.meshes, tally.parts,
              tally.repeated);
  EXPECT_GT(tally.meshes, 20);
  EXPECT_GT(tally.parts, 0);
  EXPECT_GT(tally.repeated, 0);
}

TEST(SurfaceRows, VoxelsStandByThemselves) {
  const std::vector<CloudPoint> points{{0, 0, 0}, {1, 2, 3}, {0, 0, 0}};
  const Surface cloud(points, 0.5f), bare(points, 0.0f);
  std::size_t slices = 0;
  const SurfaceRows voxels = listed(cloud, 1, slices), dots = listed(bare, 1, slices);
  EXPECT_EQ(voxels.corners_each, 8u);
  EXPECT_EQ(voxels.vertices.size(), 24u);
  EXPECT_EQ(voxels.loaded, 3u);
  EXPECT_EQ(dots.corners_each, 1u);
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(same(dots.vertices[dots.element(i)[0]], bare.point(i)));
    for (std::uint32_t k = 0; k < 8; ++k)
      EXPECT_TRUE(same(voxels.vertices[voxels.element(i)[k]], cloud.element(i).corner[k]));
  }
}

}  // namespace
}  // namespace clearance
