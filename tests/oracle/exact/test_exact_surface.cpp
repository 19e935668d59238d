// Tests of the oracle of non-convex bodies: compared with all pairs of triangles, with closed forms, and with itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "tests/oracle/cases/cases.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/exact/lattice.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 17;

/// The least distance of two triangles, or of a triangle and a hull, over all pairs.
Value least_of_all_pairs(const Case& c) {
  const auto parts = [](const Solid& s) {
    std::vector<std::vector<Vec3d>> out;
    for (const Triangle& t : s.triangles) out.push_back({s.vertices[t[0]], s.vertices[t[1]], s.vertices[t[2]]});
    if (out.empty()) out.push_back(s.vertices);
    return out;
  };
  std::optional<Value> least;
  for (const auto& p : parts(*c.a))
    for (const auto& q : parts(*c.b)) {
      const Value v =
          exact_distance(ConvexPartView{p, c.a->radius}, c.X_wa, ConvexPartView{q, c.b->radius}, c.X_wb, false)
              .distance;
      if (!least || v.compare(*least) < 0) least = v;
    }
  return *least;
}

// Pairs that the search skips are no nearer. A body inside a solid, and no other, has distance 0.
TEST(ExactSurface, FindsTheLeastOfAllPairsOfTriangles) {
  int apart = 0, crossing = 0, inside = 0;
  for (const CaseClass& cls : mesh_classes())
    for (std::uint64_t i = 0; i < 8; ++i) {
      const Case c = make_case(cls, kSeed, i);
      if (std::max<std::size_t>(c.a->triangles.size(), 1) * std::max<std::size_t>(c.b->triangles.size(), 1) > 2500)
        continue;
      const Result r = exact_answer(c);
      const Value least = least_of_all_pairs(c);
      if (least.sign == 0) {
        ++crossing;
        EXPECT_TRUE(r.cores_overlap) << cls.name << ' ' << i;
      } else if (r.cores_overlap) {
        ++inside;
        EXPECT_TRUE(c.a->is_solid || c.b->is_solid) << cls.name << ' ' << i;
      } else {
        ++apart;
        EXPECT_EQ(r.distance.compare(least), 0) << cls.name << ' ' << i;
      }
    }
  std::printf("%d apart, %d crossing, %d inside\n", apart, crossing, inside);
  EXPECT_GT(apart, 40);
  EXPECT_GT(crossing, 10);
  EXPECT_GT(inside, 3);
}

// Solids of lattice cubes: the cube of a point determines its winding number.
TEST(ExactSurface, WindsOnceAroundWhatCubesHold) {
  Random random(kSeed);
  int inside = 0, outside = 0;
  for (int i = 0; i < 60; ++i) {
    const Mesh mesh = cells(random, 2);  // cubes between even coordinates
    Solid s{mesh.vertices, 0, mesh.triangles, true};
    int n = 1;
    const Pose X = lattice_rotation(random, &n);
    for (Vec3d& v : s.vertices) v = v * static_cast<double>(n);
    for (int x = -1; x <= 7; x += 2)
      for (int y = -1; y <= 7; y += 2)
        for (int z = -1; z <= 7; z += 2) {
          // A cube is there if the number of faces between its middle and far away along x is odd.
          int faces = 0;
          for (const Triangle& t : mesh.triangles) {
            const Vec3d &p = mesh.vertices[t[0]], &q = mesh.vertices[t[1]], &r = mesh.vertices[t[2]];
            const auto between = [&](int k, int at) {
              return std::min({p[k], q[k], r[k]}) < at && at < std::max({p[k], q[k], r[k]});
            };
            faces += p.x == q.x && q.x == r.x && p.x > x && between(1, y) && between(2, z);
          }
          const int expected = faces / 2 % 2;  // two triangles of a face
          const Solid point{{{n * x * 1.0, n * y * 1.0, n * z * 1.0}}, 0};
          const Vec3d p = in_world(point, X, n)[0];
          EXPECT_EQ(exact_winding_number(body_view(s), X, p), expected);
          Solid back = s;
          back.triangles = flipped(mesh).triangles;
          EXPECT_EQ(exact_winding_number(body_view(back), X, p), -expected);
          (expected ? inside : outside)++;
          const Result r = exact_distance(body_view(s), X, BodyView{std::span(&p, 1), {}, false, 0}, {});
          EXPECT_EQ(r.cores_overlap, expected == 1);
        }
  }
  EXPECT_GT(inside, 200);
  EXPECT_GT(outside, 200);
}

// A box within a box: known distances, which depend on the kind of the outer one.
TEST(ExactSurface, KnowsInsideFromOutside) {
  const Mesh outer = box_mesh({1, 1, 1}), hole = flipped(box_mesh({0.75, 0.75, 0.75}));
  const Solid small{box({0.25, 0.25, 0.25}), 0.125};
  const auto distance_in = [&](const Mesh& mesh, bool is_solid, Vec3d t) {
    const Solid s{mesh.vertices, 0, mesh.triangles, is_solid};
    const Result r = exact_distance(body_view(s), {}, body_view(small), {t});
    const Result swapped = exact_distance(body_view(small), {t}, body_view(s), {});
    EXPECT_EQ(r.distance.compare(swapped.distance), 0);
    return r.distance.lower();
  };
  Mesh hollow = outer;
  append(hollow, hole);
  Mesh twice = outer;
  append(twice, flipped(hole));
  EXPECT_EQ(distance_in(outer, true, {0, 0, 0}), -0.125) << "inside: 0, less the radius";
  EXPECT_EQ(distance_in(outer, false, {0, 0, 0}), 0.625);
  EXPECT_EQ(distance_in(hollow, true, {0, 0, 0}), 0.375);
  EXPECT_EQ(distance_in(hollow, true, {0.25, 0, 0}), 0.125);
  EXPECT_EQ(distance_in(hollow, true, {0.5, 0, 0}), -0.125) << "exact contact";
  EXPECT_EQ(distance_in(twice, true, {0, 0, 0}), -0.125);
  EXPECT_EQ(distance_in(flipped(outer), true, {0, 0, 0}), -0.125);
  EXPECT_EQ(distance_in(outer, true, {2, 0, 0}), 0.625);
}

TEST(ExactSurface, RejectsThePointsOfTriangles) {
  const Mesh mesh = box_mesh({1, 1, 1});
  const Solid s{mesh.vertices, 0, mesh.triangles, true};
  for (const Vec3d& p : {Vec3d{1, 1, 1}, Vec3d{1, 0.5, 1}, Vec3d{1, 0.5, 0.25}})
    EXPECT_THROW(exact_winding_number(body_view(s), {}, p), std::invalid_argument);
  EXPECT_EQ(exact_winding_number(body_view(s), {}, {0.5, 0.5, 0.5}), 1);  // in the planes of none, or of diagonals
}

// Every closed mesh is closed and, if it does not cross itself, winds around a point at most once.
TEST(ExactSurface, MeshesAreClosed) {
  Random random(kSeed);
  for (int i = 0; i < 200; ++i) {
    const Mesh mesh = any_mesh(random);
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (const Triangle& t : mesh.triangles)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t p = t[k], q = t[(k + 1) % 3];
        edges[std::minmax(p, q)] += p < q ? 1 : -1;
      }
    for (const auto& [edge, sum] : edges) EXPECT_EQ(sum, 0) << i;
    const Solid s{mesh.vertices, 0, mesh.triangles, true};
    int most = 0;
    for (int k = 0; k < 20; ++k) {
      const int w = exact_winding_number(body_view(s), {}, random.direction() * random.uniform(0, 1.5));
      EXPECT_GE(w, 0) << i;
      most = std::max(most, w);
    }
    EXPECT_LE(most, 3) << i;  // boards that overlap
  }
}

}  // namespace
}  // namespace clearance::exact
